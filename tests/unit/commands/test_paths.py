"""Where a graph may be: a run by name or folder, a bare folder, or a workflow.json from anywhere."""

import json
import shutil

import pytest

SAY = "Pick the alphabet soup and place it in the basket"


@pytest.fixture
def bare(make_run, tmp_path):
    """A folder that holds a graph and nothing of a run."""
    return shutil.copytree(make_run().graph_folder, tmp_path / "my graph")


@pytest.mark.parametrize(
    "name", ["little-001", "runs/little-001", "runs/little-001/generate", "runs/little-001/generate/workflow.json"]
)
def test_a_run_is_meant_by_name_folder_or_graph(gap, make_run, name):
    make_run()
    assert json.loads(gap("validate", name, "--json").out)["run"] == "little-001"


@pytest.mark.parametrize("at", ["my graph", "./my graph", "my graph/workflow.json"])
def test_a_bare_folder_goes_the_whole_way(gap, bare, at):
    done = gap("validate", at, "--task", "little")
    assert done.code == 0 and "gap rehearse 'my graph'" in done.out
    assert gap("rehearse", at, "-n", 1, "--record", "none").code == 0
    assert gap("run", at, "--dry").code == gap("view", at).code == gap("report", at).code == 0
    made = {p.relative_to(bare).as_posix() for p in bare.rglob("*") if p.is_file()}
    assert {"run.yaml", "lock.json", "validate/findings.json", "rehearse/00/summary.json", "run/result.json",
            "view.html", "report.html"} <= made  # fmt: skip
    assert "gap validate 'my graph'" in (bare / "report.html").read_text().replace("&#39;", "'")


def test_a_workflow_in_the_working_folder_is_found(gap, bare, monkeypatch):
    monkeypatch.chdir(bare)
    assert gap("validate", "workflow.json").code == gap("validate", ".").code == 0


def test_without_a_task_a_graph_is_read_and_checked_and_not_rehearsed(gap, bare):
    assert gap("validate", bare).code == 0
    assert gap("view", bare).code == gap("run", bare, "--dry").code == 0
    done = gap("rehearse", bare, "-n", 1)
    assert done.code == 1 and "--task NAME" in done.err
    assert not (bare / "run.yaml").exists()
    done = gap("rehearse", bare, "-n", 1, "--task", "little")
    assert done.code == 1 and "task changed from none to little" in done.err and "gap validate" in done.err
    assert gap("validate", bare).code == gap("rehearse", bare, "-n", 1, "--record", "none").code == 0


def test_a_task_with_its_variant_is_noted_once(gap, bare):
    done = gap("validate", bare, "--task", "little:huge")
    assert done.code == 1 and "variant 'huge'" in done.err and not (bare / "run.yaml").exists()
    assert gap("validate", bare, "--task", "little").code == 0
    done = gap("validate", bare, "--task", "other")
    assert done.code == 1 and "says task little, not other" in done.err


def test_the_task_of_a_run_is_its_own(gap, make_run):
    run = make_run()
    assert gap("validate", run.path, "--task", "little").code == 0
    assert "says task little" in gap("validate", run.path, "--task", "fulfill-grocery").err


def test_goals_that_are_missing_are_asked_for(gap, bare):
    (bare / "goals.json").unlink()
    assert gap("validate", bare, "--task", "little").code == gap("run", bare, "--dry").code == 0
    done = gap("rehearse", bare, "-n", 1)
    assert done.code == 1 and "no goals.json" in done.err and '"scene": SCENE' in done.err


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nowhere", "no run 'nowhere'"),
        ("./nowhere", "is no run and holds no graph"),
        ("graph.json", "is not a workflow.json"),
    ],
)
def test_what_is_no_graph_is_refused(gap, tmp_path, name, said):
    (tmp_path / "graph.json").write_text("{}")
    for verb in ("validate", "view", "run", "rehearse"):
        done = gap(verb, name)
        assert done.code == 1 and said in done.err and done.out == ""


def test_a_bare_graph_has_no_plan_to_generate_from(gap, bare):
    done = gap("generate", bare)
    assert done.code == 1 and "gap plan --task TASK" in done.err


def test_edits_of_a_generated_graph_are_kept_until_asked(gap, tmp_path):
    assert gap("plan", "--task", "fulfill-grocery", "--say", SAY).code == gap("generate").code == 0
    run = tmp_path / "runs/fulfill-grocery-001"
    file = run / "generate/subgraphs/grasp_alphabet_soup.py"
    good = file.read_text()
    assert gap("generate").code == 0
    file.write_text(good.replace("gripper.Close", "gripper.Clsoe"))
    done = gap("generate")
    assert done.code == 1 and "generate/subgraphs/grasp_alphabet_soup.py" in done.err and "--overwrite" in done.err
    done = gap("validate", "--json")
    (finding,) = json.loads(done.out)["findings"]
    assert done.code == 1 and "gripper.Clsoe" in finding["message"]
    assert finding["file"] == "generate/subgraphs/grasp_alphabet_soup.py" and finding["line"] > 1
    assert gap("generate", "--overwrite").code == gap("validate").code == 0
    assert file.read_text() == good
