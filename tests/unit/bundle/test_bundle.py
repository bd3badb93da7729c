import json

import pytest

from gap_runtime.bundle.bundle import GOALS, WORKFLOW, GraphBundle
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.errors import DocumentError, RunError, WorkflowError
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.testing import fake_workflow

POINTS = 'CHECKPOINTS = [Checkpoint("near", \'w.body("can").y < 0.04\')]\n'
SCRIPT = "def run(ctx) -> None:\n    pass\n"
GOAL = {"schema": "gap/goals/v1", "scene": "two", "goals": [{"predicate": "open", "roles": {"target": "can"}}]}
EXITS = {"success": {"done": ""}, "failure": "failed"}
SKILL = {
    "kind": "composite", "template": "t", "tools": ["fake.Look", "see"], "exits": EXITS,
    "parameters": {"pace": {"type": "float", "default": 1.0}, "tries": {"type": "int", "default": 3}},
}  # fmt: skip
SEE = {"kind": "atomic", "tools": ["camera.Shoot"], "exits": EXITS}


@pytest.fixture
def folder(tmp_path):
    data = dump_workflow(fake_workflow({"look": "fake.Look"}, [("START", "look"), ("look", "done")]))
    main = data["subgraphs"]["main_sg"]
    main["nodes"]["grip"] = {"type": "script", "script": "scripts/main_sg/grip.py"}
    main["parameters"] = {"pace": 2.0}
    files = {
        WORKFLOW: json.dumps(data), GOALS: json.dumps(GOAL), "checkpoints/main_sg.py": POINTS,
        "scripts/main_sg/grip.py": SCRIPT, "scripts/main_sg/unused.py": "!", "notes.md": "mine",
    }  # fmt: skip
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_folder_is_read_for_what_its_workflow_names(folder):
    bundle = GraphBundle.load(folder)
    assert sorted(bundle.files) == ["checkpoints/main_sg.py", GOALS, "scripts/main_sg/grip.py", WORKFLOW]
    assert bundle.goals.scene == "two" and bundle.checkpoints["main_sg"][0].name == "near"


def test_what_is_written_reads_back_equal(folder, tmp_path):
    bundle = GraphBundle.load(folder).replace({"scripts/main_sg/grip.py": SCRIPT + "# no newline, umlaut ü"})
    bundle.write(tmp_path / "copy")
    assert GraphBundle.load(tmp_path / "copy") == bundle
    assert (tmp_path / "copy/scripts/main_sg/grip.py").read_bytes().endswith("ü".encode())


def test_a_changed_bundle_is_another_one(folder):
    bundle = GraphBundle.load(folder)
    changed = bundle.replace({GOALS: json.dumps({**GOAL, "scene": "other"})})
    assert (bundle.goals.scene, changed.goals.scene) == ("two", "other")


def test_a_file_that_cannot_be_read_is_left_to_the_validator(folder):
    (folder / "scripts/main_sg/grip.py").write_bytes(b"\xff")
    assert "scripts/main_sg/grip.py" not in GraphBundle.load(folder).files


@pytest.mark.parametrize("path", ["../outside.py", "/etc/hostname", "scripts/../../outside.py"])
def test_no_script_is_read_from_outside_the_folder(folder, path):
    (folder.parent / "outside.py").write_text("secret")
    data = json.loads((folder / WORKFLOW).read_text())
    data["subgraphs"]["main_sg"]["nodes"]["grip"]["script"] = path
    (folder / WORKFLOW).write_text(json.dumps(data))
    assert path not in GraphBundle.load(folder).files


def test_a_folder_without_a_workflow_is_refused(tmp_path):
    with pytest.raises(DocumentError, match=WORKFLOW):
        GraphBundle.load(tmp_path)
    (tmp_path / WORKFLOW).write_text('{"version": 3}')
    with pytest.raises(WorkflowError):
        GraphBundle.load(tmp_path)


def test_without_goals_one_is_told_what_to_write(folder):
    (folder / GOALS).unlink()
    with pytest.raises(RunError, match=r'"scene": SCENE'):
        _ = GraphBundle.load(folder).goals


def test_parameters_are_the_skills_defaults_and_what_the_workflow_says_instead(folder):
    skills = {"fake": SkillContract.load(SKILL, "fake")}
    assert GraphBundle.load(folder).parameters(skills) == {"main_sg": {"pace": 2.0, "tries": 3}}


class Tool:
    def __init__(self, schema_hash):
        self.schema_hash = schema_hash


def digest(folder, *, look="1", fake="f", tries=3):
    skill = {**SKILL, "parameters": {**SKILL["parameters"], "tries": {"type": "int", "default": tries}}}
    skills = {"fake": SkillContract.load(skill, "fake"), "see": SkillContract.load(SEE, "see")}
    tools = {name: Tool(look) for name in ("fake.Look", "camera.Shoot", "other.Tool")}
    return GraphBundle.load(folder).digest(tools, skills, {"fake": fake, "see": "s", "other": "o"})


def test_the_digest_names_the_tools_and_skills_relied_on(folder):
    found = digest(folder)
    assert set(found.tools) == {"fake.Look", "camera.Shoot"}  # the atomic skill's own tool too
    assert set(found.skills) == {"fake", "see"}
    assert found == digest(folder) and found.sha256 == digest(folder).sha256


@pytest.mark.parametrize("name", [WORKFLOW, GOALS, "checkpoints/main_sg.py", "scripts/main_sg/grip.py"])
def test_an_edited_file_changes_the_digest_and_is_named(folder, name):
    before = digest(folder)
    (folder / name).write_text((folder / name).read_text() + "\n")
    assert before.changes(digest(folder)) == [f"{name} changed"]
    assert before.sha256 != digest(folder).sha256
    assert before.changes(digest(folder), "generate/") == [f"generate/{name} changed"]


def test_a_file_that_came_or_went_is_named(folder):
    before = digest(folder)
    (folder / GOALS).unlink()
    assert before.changes(digest(folder)) == [f"{GOALS} is gone"]
    assert digest(folder).changes(before) == [f"{GOALS} is new"]


def test_another_tool_contract_or_skill_changes_the_digest_and_is_named(folder):
    before = digest(folder)
    assert before.changes(digest(folder, fake="g")) == ["skill fake changed"]
    assert before.changes(digest(folder, look="2")) == [
        "the contract of tool camera.Shoot changed", "the contract of tool fake.Look changed",
    ]  # fmt: skip
    assert before.changes(digest(folder, tries=4)) == ["parameters of main_sg changed"]


def test_what_is_not_used_changes_nothing(folder):
    before = digest(folder)
    (folder / "notes.md").write_text("more")
    (folder / "scripts/main_sg/unused.py").write_text("?")
    assert before.changes(digest(folder)) == []
