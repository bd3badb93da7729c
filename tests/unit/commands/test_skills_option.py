"""`--skills PATH`: skills beside the installed ones, recorded in the run, so that later verbs and workers see them."""

import json
import shutil

import pytest
import yaml

import morsl

GROCERY = ("plan", "--task", "fulfill-grocery", "--say", "Pick the milk and place it in the basket")


@pytest.fixture
def own(tmp_path, plugin_folder):
    """A folder with one skill, `own`, that no plugin brings."""
    folder = tmp_path / "my skills"
    shutil.copytree(plugin_folder / "little_cell/skills/fake", folder / "own")
    skill = folder / "own/SKILL.md"
    skill.write_text(skill.read_text().replace("name: fake", "name: own"))
    return folder


def test_a_run_remembers_its_skills(gap, make_run, own, tmp_path, monkeypatch):
    run = make_run()
    file = run.path / "generate/workflow.json"
    file.write_text(file.read_text().replace('"skill": "fake"', '"skill": "own"'))
    assert "there is no skill 'own'" in gap("validate").out
    assert gap("validate", "--skills", own / "own").code == 0
    recorded = (run.path / "run.yaml").read_bytes()
    assert yaml.safe_load(recorded)["skills"] == ["../../my skills/own"]
    assert "own" in json.loads((run.path / "lock.json").read_text())["skills"]
    monkeypatch.chdir(tmp_path.parent)
    done = gap("rehearse", run.path, "-n", 1, "--record", "none", "--json")  # in a worker process, without the option
    assert done.code == 0, done.err
    assert json.loads(done.out)["summary"]["success"]["of"] == 1
    assert gap("validate", run.path, "--skills", own / "own").code == 0
    assert (run.path / "run.yaml").read_bytes() == recorded


def test_an_own_skill_replaces_the_installed_one_of_its_name(gap, tmp_path):
    mine = tmp_path / "mine/grasp-direct-ik"
    shutil.copytree(f"{morsl.__path__[0]}/grasp-direct-ik", mine)
    script = mine / "scripts/plan_grasp.py"
    script.write_text(script.read_text() + "\n# mine\n")
    assert gap(*GROCERY).code == 0
    done = gap(*GROCERY, "--skills", tmp_path / "mine")
    assert done.code == 0 and "grasp-direct-ik of plugin 'morsl' is replaced" in done.err
    assert gap("generate").code == 0
    runs = [tmp_path / f"runs/fulfill-grocery-00{i}" for i in (1, 2)]
    locks = [json.loads((run / "lock.json").read_text())["skills"] for run in runs]
    assert {name for name in locks[0] if locks[0][name] != locks[1][name]} == {"grasp-direct-ik"}
    assert any(p.read_text().endswith("# mine\n") for p in runs[1].glob("generate/scripts/*/plan_grasp.py"))


@pytest.mark.parametrize("how", ["option", "environment"])
def test_the_library_shows_them(gap, own, monkeypatch, how):
    option = ("--skills", own) if how == "option" else ()
    if how == "environment":
        monkeypatch.setenv("GAP_SKILLS_PATH", str(own))
    listed = json.loads(gap("skills", "list", *option, "--json").out)
    assert {"own", "perception-single"} <= {s["name"] for s in listed}
    assert gap("skills", "show", "own", *option).code == 0
    assert "own" not in {s["name"] for s in json.loads(gap("skills", "list", "--json").out)} or how == "environment"


def test_a_folder_that_is_not_there_is_a_usage_error(gap, tmp_path):
    done = gap(*GROCERY, "--skills", tmp_path / "nowhere")
    assert done.code == 2 and "nowhere" in done.err and not (tmp_path / "runs").exists()
