"""The gate before a rehearsal or a run: what is not as it was validated is refused by name."""

import json

import pytest

from gap_cli.rehearse.rehearsal import rehearse
from gap_cli.rehearse.single_run import run_once
from gap_cli.workspace.run import Run
from gap_runtime.errors import RunError


def refusal(run):
    """What `gap rehearse` and `gap run` both say."""
    messages = []
    for refused in (lambda: rehearse(Run(run.path), 1, record="none"), lambda: run_once(Run(run.path))):
        with pytest.raises(RunError) as caught:
            refused()
        assert caught.value.hint == f"Type: gap validate {run.argument}"
        messages.append(caught.value.message)
    assert messages[0] == messages[1]
    return messages[0].removeprefix(f"{run.name} is not what was validated: ")


@pytest.mark.parametrize(
    "name",
    [
        "generate/workflow.json",
        "generate/goals.json",
        "generate/checkpoints/main_sg.py",
        "generate/subgraphs/main_sg.py",
        "plan/plan.json",
        "plan/spec.py",
    ],
)
def test_an_edited_file_is_refused_by_name(make_run, accept, name):
    run = make_run()
    for made in ("generate/subgraphs/main_sg.py", "plan/spec.py"):
        (run.path / made).parent.mkdir(exist_ok=True)
        (run.path / made).write_text("sg = 1\n")
    accept(run)
    file = run.path / name
    file.write_text(file.read_text() + "\n")
    assert refusal(run) == f"{name} changed."


def test_an_edited_script_is_refused_by_name(make_run, accept):
    run = make_run()
    file = run.path / "generate/workflow.json"
    script = run.path / "generate/scripts/main_sg/wait.py"
    script.parent.mkdir(parents=True)
    script.write_text("def run(ctx) -> None:\n    pass\n")
    file.write_text(
        file.read_text().replace('"tool", "tool": "fake.Look"', '"script", "script": "scripts/main_sg/wait.py"')
    )
    accept(run)
    script.write_text("def run(ctx) -> None:\n    print(1)\n")
    assert refusal(run) == "generate/scripts/main_sg/wait.py changed."


def test_whatever_came_or_went_is_named(make_run):
    run = make_run()
    (run.path / "generate/goals.json").unlink()
    (run.path / "plan/spec.py").write_text("spec = 1\n")
    assert refusal(run) == "generate/goals.json is gone, plan/spec.py is new."


@pytest.fixture
def edit_plugin(plugin_folder, monkeypatch):
    """Change a file of the installed plugin for the length of a test."""
    kept = {}

    def edit(name, old, new):
        file = plugin_folder / name
        kept.setdefault(file, file.read_text())
        assert old in file.read_text()
        file.write_text(file.read_text().replace(old, new))
        import importlib
        import sys

        for module in [m for m in sys.modules if m.startswith("little_cell")]:
            monkeypatch.delitem(sys.modules, module)
        importlib.invalidate_caches()

    yield edit
    for file, text in kept.items():
        file.write_text(text)


@pytest.mark.parametrize(
    ("file", "old", "new", "named"),
    [
        ("little_cell/skills/fake/SKILL.md", "Do it.", "Do it well.", "skill fake changed"),
        ("little_cell/skills/fake/contract.yaml", "default: 1.0", "default: 1.5", "skill fake changed"),
        ("little_cell/__init__.py", "seconds: float = 0.2", "seconds: float = 0.3",
         "the contract of tool cell.Act changed"),
        ("little_cell/__init__.py", 'resources=("arm:0",), deadline_s=30.0)',
         'resources=("arm:0",), deadline_s=30.0, provider="mine")', "the provider of tool cell.Act changed"),
        ("little_cell/tasks/little/task.yaml", "mass: 0.1", "mass: 0.3", "task little changed"),
        ("little_cell/fake.xml", "<mujoco/>", "<mujoco></mujoco>", "robot fake changed"),
    ],
)  # fmt: skip
def test_what_it_was_checked_against_is_refused_by_name(make_run, edit_plugin, file, old, new, named):
    run = make_run()
    edit_plugin(file, old, new)
    lock = (run.path / "lock.json").read_bytes()
    assert named in refusal(run)
    assert (run.path / "lock.json").read_bytes() == lock


def test_what_it_does_not_use_changes_nothing(make_run, edit_plugin):
    run = make_run()
    edit_plugin("little_cell/__init__.py", "class Cell", '@tool("cell.New", effect="pure", deadline_s=1.0)\n'
                'def new(ctx: ToolContext) -> float:\n    """New."""\n    return 1.0\n\nclass Cell')  # fmt: skip
    edit_plugin("little_cell/__init__.py", "*FAKE_TOOLS, act)", "*FAKE_TOOLS, act, new)")
    rehearse(run, 1, record="none")


@pytest.mark.parametrize(("key", "old"), [("engine", "0.0.1"), ("sandbox", "none")])
def test_another_engine_or_jail_is_refused_by_name(make_run, key, old):
    run = make_run()
    file = run.path / "lock.json"
    lock = json.loads(file.read_text())
    file.write_text(json.dumps({**lock, key: old}))
    assert refusal(run) == f"{key} changed from {old} to {lock[key]}."


def test_another_library_is_refused_by_name(make_run):
    run = make_run()
    file = run.path / "lock.json"
    lock = json.loads(file.read_text())
    file.write_text(json.dumps({**lock, "libraries": {**lock["libraries"], "numpy": "1.0"}}))
    assert refusal(run) == "library numpy changed."
    file.unlink()
    assert refusal(run) == "lock.json is gone."


def test_many_changes_are_counted(make_run):
    run = make_run()
    for i in range(9):
        (run.path / f"generate/subgraphs/s{i}.py").parent.mkdir(exist_ok=True)
        (run.path / f"generate/subgraphs/s{i}.py").write_text("")
    assert refusal(run).endswith("s5.py is new, and 3 more.")


def test_a_dry_run_needs_no_validation(make_run):
    run = make_run()
    (run.path / "generate/goals.json").unlink()
    (run.path / "validate/findings.json").unlink()
    assert run_once(run, dry=True).success
