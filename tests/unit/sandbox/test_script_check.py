import pytest

from gap_cli.sandbox import script_check
from gap_cli.sandbox.script_check import check_scripts

GOOD = "from gap_runtime.contracts.types import Vec3\n\n\ndef run(ctx, at: Vec3) -> None:\n    ctx.tool('x.Y', at=at)\n"


@pytest.mark.parametrize(
    ("source", "line", "said"),
    [
        ("from nowhere import CameraObservation\ndef run(ctx) -> None: ...", 1, "nowhere cannot be imported"),
        ("import math\nimport requests\ndef run(ctx) -> None: ...", 2, "requests cannot be imported"),
        ("def run(ctx) -> None:\n    open('x')", 2, "open is not available"),
        ("def run(ctx) -> None: ...\nreturn 1", 2, "'return' outside function"),
        ("def run(ctx) -> None:\n  pass\n   pass", 3, "is not Python"),
        ("def run(ctx) -> None: ...\nx = 1 / 0", 2, "ZeroDivisionError"),
        ("from gap_runtime.contracts.types import Vector\ndef run(ctx) -> None: ...", 1, "cannot import name 'Vector'"),
        ("import math\ndef run(ctx, at: Vec3) -> None: ...", 2, "'Vec3' is not defined"),
        ("def move(ctx) -> None: ...", None, "no function run"),
    ],
)
def test_what_would_fail_after_the_gripper_closed_is_found_before_with_its_line(source, line, said):
    (problem,) = check_scripts({"scripts/a/b.py": source, "good.py": GOOD})
    assert (problem.file, problem.line) == ("scripts/a/b.py", line)
    assert said in problem.message and "/work" not in problem.message and "site-packages" not in problem.message


def test_every_problem_of_the_text_is_told_at_once():
    found = check_scripts({"a.py": "import requests\nimport nowhere\ndef run(ctx) -> None:\n    exec('1')"})
    assert [p.line for p in found] == [1, 2, 4] and "Importable: " in found[0].hint


def test_nothing_of_a_script_is_called():
    assert check_scripts({"a.py": "def run(ctx, far: float) -> None:\n    raise ValueError\n"}) == []
    (problem,) = check_scripts({"a.py": "import math\nmath.nan.nothing\ndef run(ctx) -> None: ...\n"})
    assert "AttributeError" in problem.message


def test_an_endless_module_is_stopped(monkeypatch):
    from gap_cli.sandbox import scripts

    monkeypatch.setattr(scripts, "LOAD_LIMIT_S", 0.5)
    (problem,) = check_scripts({"a.py": "while True: pass\ndef run(ctx) -> None: ...\n"})
    assert "longer than" in problem.message


def test_no_jail_is_started_for_nothing(monkeypatch):
    monkeypatch.setattr(script_check, "ScriptJail", None)
    assert check_scripts({}) == []
    assert len(check_scripts({"a.py": "import requests\n"})) == 1
