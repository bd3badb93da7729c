"""The house rules a machine can check: which room may import which, what stays light, how long a file may be."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HEAVY = ("mujoco", "torch", "cv2", "sklearn", "dm_control", "ompl", "pytorch_kinematics")
# Lower numbers know nothing of higher ones; rooms of one number do not import each other.
LAYER = {
    "gap_runtime.contracts": 0,
    "gap_runtime.graph": 1,
    "gap_runtime.run": 2,
    "gap_runtime.bundle": 2,
    "gap_runtime.journal": 2,
    "gap_runtime.safety": 1,
    "gap_runtime.testing": 3,
    "gap_cli.skills": 3,
    "gap_cli.workspace": 4,
    "gap_cli.builder": 5,
    "gap_cli.analysis": 5,
    "gap_cli.validate": 6,
    "gap_cli.render": 6,
    "gap_cli.sandbox": 6,
    "gap_cli.testing": 7,
    "gap_cli.author": 7,
    "gap_cli.rehearse": 7,
    "gap_cli.refine": 8,
    "gap_cli.deploy": 8,
    "gap_cli.report": 8,
    "gap_cli.bench": 8,
    "gap_cli.commands": 9,
}
# Files beside the rooms, open to all.
FOUNDATIONS = {"gap_runtime.errors", "gap_runtime.hookspecs", "gap_runtime.__version__", "gap_cli.__version__"}
SOURCES = sorted(p for room in ("gap_runtime", "gap_cli", "plugins", "morsl") for p in (ROOT / room).rglob("*.py"))


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


@pytest.mark.parametrize(
    "path", [p for p in SOURCES if p.relative_to(ROOT).parts[0] != "plugins"], ids=lambda p: str(p.relative_to(ROOT))
)
def test_engine_imports_point_one_way(path):
    room = ".".join(path.relative_to(ROOT).with_suffix("").parts[:2])
    if room not in LAYER:
        return
    for name in imports(path):
        target = ".".join(name.split(".")[:2])
        if not name.startswith(("gap_runtime", "gap_cli")) or name.startswith(tuple(FOUNDATIONS)):
            continue
        allowed = target == room or (target in LAYER and LAYER[target] < LAYER[room])
        allowed = allowed or (target == "gap_runtime.plugins" and LAYER[room] > 2)
        assert allowed, f"{room} may not import {name}"


@pytest.mark.parametrize("path", [p for p in SOURCES if "plugins" in p.parts], ids=lambda p: str(p.relative_to(ROOT)))
def test_plugins_see_contracts_and_the_hook_marker_only(path):
    for name in imports(path):
        if name.startswith(("gap_cli", "gap_runtime")):
            assert name.startswith(("gap_runtime.contracts", "gap_runtime.hookspecs")), name


def test_contracts_import_nothing_of_ours():
    for path in (ROOT / "gap_runtime" / "contracts").rglob("*.py"):
        for name in imports(path):
            assert not name.startswith("gap_") or name.startswith("gap_runtime.contracts"), (path.name, name)


@pytest.mark.parametrize("folder", sorted({p.parent for p in SOURCES}), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_folder_holds_at_most_twenty_python_files(folder):
    assert len(list(folder.glob("*.py"))) <= 20


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_are_short_and_say_what_they_are_for(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 300, "split it along its seams"
    assert not text.strip() or ast.get_docstring(ast.parse(text)), "a module opens with one sentence"


@pytest.mark.parametrize("arguments", [["--help"], ["validate", "--help"], ["tools", "list", "--json"]], ids=" ".join)
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
