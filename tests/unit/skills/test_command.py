"""`gap skills` on the command line."""

from __future__ import annotations

import json
import shutil

import pytest
from typer.testing import CliRunner

import morsl
from gap_cli.commands.skills import app
from gap_runtime.errors import DocumentError, UnknownNameError

MORSL = morsl.__path__[0]


def gap(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_list_names_every_skill():
    listed = json.loads(gap("list", "--json").stdout)
    assert {"perception-single", "grasp-direct-ik", "transport-to-drop"} <= {s["name"] for s in listed}
    shown = gap("list").stdout
    assert all(s["name"] in shown for s in listed)


def test_show_prints_what_agents_read():
    data = json.loads(gap("show", "grasp_direct_ik", "--json").stdout)
    assert data["contract"]["roles"] == ["target"]
    assert "## Hard rules" in data["body"]
    assert "jaw_margin" in gap("show", "grasp-direct-ik").stdout


def test_an_unknown_skill_is_named():
    assert isinstance(gap("show", "grasp-direct-i").exception, UnknownNameError)


def test_check_passes_a_good_skill_and_fails_a_bad_one(tmp_path):
    good = f"{MORSL}/perception-single"
    assert gap("check", good).exit_code == 0
    bad = tmp_path / "perception-single"
    shutil.copytree(good, bad)
    template = bad / "templates" / "subgraph.py.j2"
    template.write_text(template.read_text().replace('"observe.cameras"', '"observe.camera"'))
    done = gap("check", bad, "--json")
    assert done.exit_code == 1
    assert any("camera" in f["message"] for f in json.loads(done.stdout))


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("templates/subgraph.py.j2", "{{ on_error }}", "{{ on_eror }}", "on_eror"),
        ("templates/subgraph.py.j2", "{{ on_error }}", "{% if %}", "is not a template"),
        ("templates/subgraph.py.j2", "from gap_cli.builder.workflow", "import os\nfrom gap_cli.builder.workflow", "os"),
        ("scripts/perceive_dino_vlm.py", "object_name: str", "object_name", "has no type"),
        ("scripts/perceive_dino_vlm.py", '"vlm.Query"', '"vlm.QueryYesNo"', "does not list"),
        ("contract.yaml", "- vlm.Query", "- vlm.Qery", "vlm.Qery"),
        ("checkpoints/located.py.j2", "is_settled", "is_seetled", "is_seetled"),
        ("checkpoints/located.py.j2", 'object("name")', 'object("target")', "target"),
    ],
)
def test_check_finds(tmp_path, file, old, new, says):
    bad = tmp_path / "perception-single"
    shutil.copytree(f"{MORSL}/perception-single", bad)
    text = (bad / file).read_text()
    assert old in text
    (bad / file).write_text(text.replace(old, new))
    done = gap("check", bad, "--json")
    assert done.exit_code == 1
    assert says in done.stdout


def test_a_folder_that_is_no_skill_is_one_error(tmp_path):
    assert isinstance(gap("check", tmp_path).exception, DocumentError)


def test_new_says_what_to_type_next(tmp_path):
    done = gap("new", "wave-hello", "--into", tmp_path)
    assert done.exit_code == 0
    assert f"pip install -e {tmp_path / 'wave-hello'}" in done.stdout
    assert (
        gap("check", tmp_path / "wave-hello/gap_wave_hello/skills/wave-hello").exit_code == 1
    )  # its tool is not served
