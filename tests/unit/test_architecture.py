"""The house rules a machine can check: which room may import which, what stays light, how long a file may be."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = ("mujoco", "torch", "cv2", "sklearn", "dm_control", "ompl", "pytorch_kinematics")
LAYER = {
    "contracts": 0,
    "skills": 1,
    "graph": 1,
    "artifacts": 1,
    "sandbox": 2,
    "author": 3,
    "rehearse": 3,
    "refine": 3,
    "deploy": 3,
    "report": 3,
    "bench": 3,
    "commands": 4,
}
# Files beside the rooms, open to all.
FOUNDATIONS = {"errors", "hookspecs", "plugins", "testing", "__init__", "__version__"}
SOURCES = sorted(p for room in ("gap_cli", "plugins", "morsl") for p in (ROOT / room).rglob("*.py"))


def imports(path):
    """Modules a file imports when run, `if TYPE_CHECKING` blocks left out."""
    tree = ast.parse(path.read_text())
    hidden = {
        id(n)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.unparse(block.test)
        for n in ast.walk(block)
    }
    for node in ast.walk(tree):
        if id(node) in hidden:
            continue
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{a.name}" for a in node.names)
        elif isinstance(node, ast.Import):
            yield from (a.name for a in node.names)


@pytest.mark.parametrize("path", [p for p in SOURCES if "gap_cli" in p.parts], ids=lambda p: str(p.relative_to(ROOT)))
def test_engine_imports_point_one_way(path):
    room = path.relative_to(ROOT / "gap_cli").parts[0].removesuffix(".py")
    if room not in LAYER:
        return
    for name in imports(path):
        parts = name.split(".")
        if parts[0] != "gap_cli" or len(parts) < 2 or parts[1] in FOUNDATIONS - {"plugins"}:
            continue
        target = parts[1]
        allowed = target == room or (target in LAYER and LAYER[target] < LAYER[room])
        allowed = allowed or (target == "plugins" and room != "contracts")
        assert allowed, f"{room} may not import {name}"


@pytest.mark.parametrize("path", [p for p in SOURCES if "plugins" in p.parts], ids=lambda p: str(p.relative_to(ROOT)))
def test_plugins_see_contracts_and_the_hook_marker_only(path):
    for name in imports(path):
        if name.startswith("gap_cli"):
            assert name.startswith(("gap_cli.contracts", "gap_cli.hookspecs")), name


def test_contracts_import_nothing_of_ours():
    for path in (ROOT / "gap_cli" / "contracts").glob("*.py"):
        for name in imports(path):
            assert not name.startswith("gap_") or name.startswith("gap_cli.contracts"), (path.name, name)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_are_short_and_say_what_they_are_for(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 300, "split it along its seams"
    assert not text.strip() or ast.get_docstring(ast.parse(text)), "a module opens with one sentence"


@pytest.mark.parametrize("arguments", [["--help"], ["validate", "--help"], ["tools", "--json"]], ids=" ".join)
def test_light_commands_load_nothing_heavy(arguments):
    code = (
        "import sys, contextlib, io\n"
        "from gap_cli.main import main\n"
        f"sys.argv = ['gap', *{arguments!r}]\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit): main()\n"
        f"print(*[m for m in {HEAVY!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == ""
