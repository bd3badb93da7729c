"""`gap skills` on the command line."""

from __future__ import annotations

import json
import shutil

import pytest
import skills_ref
from typer.testing import CliRunner

import morsl
from gap_cli.commands.skills import app
from gap_cli.skills import parse_skill_md
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
        ("scripts/perceive_dino_vlm.py", "from typing", "import requests\nfrom typing", "requests cannot be imported"),
        ("scripts/perceive_dino_vlm.py", "from typing", "from nowhere import X\nfrom typing", "nowhere cannot be"),
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


FOREIGN = """---
name: Stack-Cups
description: >
  Stacks cups. Use when cups stand about.
license: MIT
allowed_tools: gripper.Open
metadata:
  category: stacking
  tags:
    - cups
  version: 1.0
gap:
  exit_conditions:
    stacked: done
---
"""
CONTRACT = """
kind: composite
stages: place
exits: {success: {stacked: done}, failure: failed}
inputs: {target_obb: OrientedBox}
tools: [gripper.Opne]
scripts: {stack: scripts/stack.py, gone: scripts/gone.py}
"""


def test_one_check_names_everything_wrong_with_every_skill(tmp_path):
    foreign = tmp_path / "theirs/deep/stack-cups"
    (foreign / "scripts").mkdir(parents=True)
    (foreign / "SKILL.md").write_text(FOREIGN)
    (foreign / "contract.yaml").write_text(CONTRACT)
    (foreign / "scripts/stack.py").write_text("def run(ctx, height):\n    pass\n")
    shutil.copytree(f"{MORSL}/perception-single", tmp_path / "ours/perception-single")
    shutil.copytree(f"{MORSL}/grasp-direct-ik", tmp_path / "ours/grasp-direct")
    done = gap("check", tmp_path / "theirs", tmp_path / "ours", "--json")
    found = json.loads(done.stdout)
    said = "\n".join(f"{f['skill']} {f['path']}: {f['message']}" for f in found)
    lines = {6: "allowed_tools", 12: "gap"}
    assert any(
        f"line {line}: " in f["message"] and words in f["message"] for line, words in lines.items() for f in found
    )
    for words in ("no text below", "stages", "parameter 'height' of run has no type"):
        assert words in said
    assert "version" not in said  # a scalar is text to the format, whatever YAML makes of it
    assert any(f["skill"].endswith("grasp-direct") and "differs from its folder" in f["message"] for f in found)
    assert not any(f["skill"].endswith("perception-single") for f in found) and done.exit_code == 1


FRONTMATTERS = {
    "as ours": "description: Use it.",
    "underscore": "description: Use it.\nallowed_tools: a",
    "hyphen": "description: Use it.\nallowed-tools: a b",
    "number": "description: Use it.\nmetadata:\n  version: 1.0",
    "boolean": "description: yes\nlicense: no\nmetadata:\n  beta: true",
    "date": "description: Use it.\nmetadata:\n  since: 2024-01-31",
    "null": "description: null\nlicense: null",
    "flow": "description: Use it.\nmetadata: {a: b}",
    "flow list": "description: Use it.\nmetadata:\n  tags: [a]",
    "extra": "description: Use it.\nversion: 1.0",
    "twice": "description: a\ndescription: b",
    "anchor": "description: &a b",
    "tag": "description: !!str b",
    "folded": "description: >\n  Use\n  it.",
    "long": f"description: {'a' * 1025}",
    "missing": "license: MIT",
    "blank": "description: ''",
}


@pytest.mark.parametrize("case", FRONTMATTERS)
def test_frontmatter_is_as_strict_as_the_formats_own_validator(tmp_path, case):
    text = f"---\nname: pour\n{FRONTMATTERS[case]}\n---\n\nbody\n"
    (tmp_path / "pour").mkdir()
    (tmp_path / "pour/SKILL.md").write_text(text)
    theirs = skills_ref.validate(tmp_path / "pour")
    try:
        parse_skill_md(text, "SKILL.md")
    except DocumentError as error:
        assert theirs and "SKILL.md:" in f"{error.where}:"
    else:
        assert theirs == []


def test_a_folder_that_is_no_skill_is_one_error(tmp_path):
    assert isinstance(gap("check", tmp_path).exception, DocumentError)


def test_new_says_what_to_type_next(tmp_path):
    done = gap("new", "wave-hello", "--into", tmp_path)
    assert done.exit_code == 0
    assert f"pip install -e {tmp_path / 'wave-hello'}" in done.stdout
    assert (
        gap("check", tmp_path / "wave-hello/gap_wave_hello/skills/wave-hello").exit_code == 1
    )  # its tool is not served


def test_check_reports_an_unreadable_script_with_the_other_problems(tmp_path):
    bad = tmp_path / "perception-single"
    shutil.copytree(f"{MORSL}/perception-single", bad)
    (bad / "scripts" / "perceive_dino_vlm.py").write_bytes(b"\xff\xfe")
    done = gap("check", bad, "--json")
    assert done.exit_code == 1 and any("UTF-8" in f["message"] for f in json.loads(done.stdout))
