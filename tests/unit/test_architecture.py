"""The house rules a machine can check: which room may import which, what stays light, how long a file may be."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parents[2]
HEAVY = ("mujoco", "torch", "cv2", "sklearn", "dm_control", "ompl", "pytorch_kinematics")
# Lower numbers know nothing of higher ones; rooms of one number do not import each other.
LAYER = {
    "gap_runtime.contracts": 0,
    "gap_runtime.graph": 1,
    "gap_runtime.run": 2,
    "gap_runtime.bundle": 3,
    "gap_runtime.journal": 2,
    "gap_runtime.safety": 1,
    "gap_runtime.testing": 3,
    "gap_cli.skills": 3,
    "gap_cli.analysis": 4,
    "gap_cli.workspace": 4,
    "gap_cli.builder": 5,
    "gap_cli.validate": 7,
    "gap_cli.render": 6,
    "gap_cli.sandbox": 6,
    "gap_cli.testing": 8,
    "gap_cli.author": 8,
    "gap_cli.rehearse": 8,
    "gap_cli.importer": 9,
    "gap_cli.refine": 9,
    "gap_cli.deploy": 9,
    "gap_cli.report": 9,
    "gap_cli.bench": 9,
    "gap_cli.commands": 10,
}
# Files beside the rooms, open to all.
FOUNDATIONS = {"gap_runtime.errors", "gap_runtime.hookspecs", "gap_runtime.__version__", "gap_cli.__version__"}
MAX_SHARED_CLASS_NAMES = 5
LIBRARIES = ("gap_control",)  # plugins that other plugins import
SOURCES = sorted(p for room in ("gap_runtime", "gap_cli", "plugins", "morsl") for p in (ROOT / room).rglob("*.py"))


@cache
def tree_of(path):
    return ast.parse(path.read_text())


def imports(path, *, type_only=False):
    """Names a file imports when run, or also those it imports for type checking."""
    tree = tree_of(path)
    hidden = (
        set()
        if type_only
        else {
            id(n)
            for block in ast.walk(tree)
            if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.unparse(block.test)
            for n in ast.walk(block)
        }
    )
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


PLUGINS_SEE = ("gap_runtime.contracts.", "gap_runtime.hookspecs.", "gap_catalogue.", "gap_control.")


@pytest.mark.parametrize("path", [p for p in SOURCES if "plugins" in p.parts], ids=lambda p: str(p.relative_to(ROOT)))
def test_plugins_see_contracts_the_catalogue_and_no_other_plugin(path):
    own = path.relative_to(ROOT / "plugins").parts[0]
    foreign = [
        n for n in imports(path) if n.startswith(("gap_", "morsl")) and not n.startswith((f"{own}.", *PLUGINS_SEE))
    ]
    assert not foreign


@pytest.mark.parametrize("library", LIBRARIES)
def test_libraries_import_contracts_only(library):
    for path in (ROOT / "plugins" / library).rglob("*.py"):
        for name in imports(path):
            assert not name.startswith("gap_") or name.startswith((library, "gap_runtime.contracts")), (path.name, name)


def test_contracts_import_nothing_of_ours():
    for path in (ROOT / "gap_runtime" / "contracts").rglob("*.py"):
        for name in imports(path):
            assert not name.startswith("gap_") or name.startswith("gap_runtime.contracts"), (path.name, name)


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(part for part in parts if part not in ("plugins", "__init__"))


@cache
def modules_in_circles():
    """Modules that import themselves by way of others."""
    modules = {module_of(path): path for path in SOURCES}
    graph = nx.DiGraph()
    for module, path in modules.items():
        for name in imports(path, type_only=True):
            target = name if name in modules else name.rpartition(".")[0]
            if target in modules and target != module:
                graph.add_edge(module, target)
    return {m for circle in nx.strongly_connected_components(graph) if len(circle) > 1 for m in circle}


def test_no_modules_import_each_other():
    assert not modules_in_circles()


@pytest.mark.xfail(strict=True, reason="names still shared; whoever brings them down removes this mark")
def test_a_class_name_means_one_thing():
    owners = defaultdict(list)
    for path in SOURCES:
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef):
                owners[node.name].append(module_of(path))
    shared = {name: found for name, found in owners.items() if len(found) > 1}
    assert len(shared) <= MAX_SHARED_CLASS_NAMES, shared


@pytest.mark.parametrize("folder", sorted({p.parent for p in SOURCES}), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_folder_holds_at_most_twenty_python_files(folder):
    assert len(list(folder.glob("*.py"))) <= 20


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_are_short_and_say_what_they_are_for(path):
    text = path.read_text()
    assert len(text.splitlines()) <= 300, "split it along its seams"
    assert not text.strip() or ast.get_docstring(tree_of(path)), "a module opens with one sentence"


def heavy_modules_after(arguments):
    """Which of HEAVY `gap` has loaded once it has done what the arguments ask, and its exit code."""
    code = (
        "import sys, contextlib, io\n"
        "from gap_cli.main import main\n"
        f"sys.argv = ['gap', *{arguments!r}]\n"
        "code = 0\n"
        "with contextlib.redirect_stdout(io.StringIO()):\n"
        "    try: main()\n"
        "    except SystemExit as done: code = done.code or 0\n"
        f"print(code, *[m for m in {HEAVY!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout.split()


@pytest.mark.parametrize("arguments", [["--help"], ["validate", "--help"], ["tools", "list", "--json"]], ids=" ".join)
def test_light_commands_load_nothing_heavy(arguments):
    assert heavy_modules_after(arguments) == ["0"]


def test_validating_a_graph_loads_nothing_heavy(make_run):
    run = make_run()
    assert heavy_modules_after(["validate", run.name, "--root", str(run.path.parent)]) == ["0"]
