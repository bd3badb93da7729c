"""`gap doctor`: what this machine has, what it lacks, and what to type about it; each check answers, none raises."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, print_json, print_table
from gap_runtime.errors import GapError

if TYPE_CHECKING:
    from gap_runtime.plugins import Registry

LIMIT_S = 120.0
NEEDED_MB = 500
_FIX = "Fix or uninstall it."
PYTHON = (3, 11)
EXTRAS = {
    "rtb-data": ("the Panda's published meshes, for looks", "pip install 'gap-cli[looks]'"),
    "skills-ref": ("the Agent Skills validator", "pip install 'gap-cli[dev]'"),
    "mcap-protobuf-support": ("reading recordings back in Python", "pip install 'gap-cli[dev]'"),
}


class Finding(NamedTuple):
    """One answer. Without `needed`, a missing thing is worth knowing and no reason to stop."""

    check: str
    ok: bool
    found: str
    hint: str = ""
    needed: bool = True


def doctor(root: Root = RUNS, json: AsJson = False) -> None:
    """Check this machine. Exit 1 when something GaP needs is missing."""
    findings = run_checks(root)
    missing = [f for f in findings if f.needed and not f.ok]
    if json:
        print_json({"ok": not missing, "checks": [f._asdict() for f in findings]})
    else:
        rows = [("ok" if f.ok else "MISSING" if f.needed else "-", f.check, f.found, f.hint) for f in findings]
        print_table("", ("", "check", "found", "do"), rows)
    if missing:
        raise typer.Exit(1)


def run_checks(root: Path) -> list[Finding]:
    """Every check, in the order a reader would ask."""
    from gap_runtime.plugins import load_registry

    findings = [_python(), _packages()]
    try:
        registry = load_registry()
    except GapError as error:
        return [*findings, Finding("plugins", False, error.message, error.hint), _disk(root)]
    findings += [*_plugins(registry), *_skills(registry), *_tasks(registry)]
    findings += [_ask(name) for name in sorted(registry.checks)]
    return [*findings, _sandbox(), _torch(), *_extras(), _disk(root)]


def answer(name: str) -> None:
    """Run one plugin's check and print what it says as JSON; what `_ask` runs in a process of its own."""
    from gap_runtime.plugins import load_registry

    try:
        data = {"ok": True, "found": str(load_registry().checks[name].value())}
    except GapError as error:
        data = {"ok": False, "found": error.message, "hint": error.hint}
    sys.stdout.write("\n" + json.dumps(data) + "\n")


def _ask(name: str) -> Finding:
    """A plugin's check may crash or hang (a graphics driver, say) without taking doctor along."""
    code = f"from gap_cli.commands.doctor import answer; answer({name!r})"
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
        return Finding(name, **json.loads(done.stdout.splitlines()[-1]))
    except subprocess.TimeoutExpired:
        return Finding(name, False, f"no answer within {LIMIT_S:g} s")
    except (ValueError, IndexError, TypeError):
        last = (done.stderr.strip().splitlines() or ["no output"])[-1]
        return Finding(name, False, f"the check ended with code {done.returncode}: {last}")


def _python() -> Finding:
    have = sys.version_info
    hint = "" if have >= PYTHON else f"Install Python {PYTHON[0]}.{PYTHON[1]} or newer."
    return Finding("python", have >= PYTHON, f"{have.major}.{have.minor}.{have.micro} at {sys.executable}", hint)


def _packages() -> Finding:
    """What gap-cli itself requires, as installed; versions are pip's business."""
    missing = [name for name in _requirements() if not _installed(name)]
    hint = "Install it again: make setup, or pip install gap-cli." if missing else ""
    return Finding("packages", not missing, f"missing: {', '.join(missing)}" if missing else "all there", hint)


def _requirements() -> Iterator[str]:
    try:
        lines = metadata.requires("gap-cli") or []
    except metadata.PackageNotFoundError:
        return
    for line in lines:
        if "extra ==" not in line:
            yield re.split(r"[^A-Za-z0-9._-]", line, maxsplit=1)[0]


def _plugins(registry: Registry) -> Iterator[Finding]:
    from gap_runtime.plugins import FIRST_PARTY

    yield Finding("plugins", True, ", ".join(f"{p.name} {p.version}" for p in registry.plugins.values()))
    for name, reason in sorted(registry.broken.items()):
        yield Finding(f"plugin {name}", False, reason, _FIX, needed=name in FIRST_PARTY)


def _skills(registry: Registry) -> Iterator[Finding]:
    from gap_cli.skills import load_library
    from gap_runtime.plugins import FIRST_PARTY

    try:
        library = load_library(registry.skill_paths)
    except GapError as error:
        yield Finding("skills", False, error.message, error.hint)
        return
    yield Finding("skills", True, f"{len(library)} skills, {len(registry.tools)} tools")
    for name, left in library.left_out.items():
        yield Finding(f"skill {name}", False, str(left), _FIX, needed=left.plugin in FIRST_PARTY)


def _tasks(registry: Registry) -> Iterator[Finding]:
    from gap_cli.commands.tasks import open_tasks
    from gap_runtime.plugins import FIRST_PARTY

    try:
        tasks, left_out = open_tasks(registry)
    except GapError as error:
        yield Finding("tasks", False, error.message, error.hint)
        return
    yield Finding("tasks", True, ", ".join(task.name for task in tasks) or "none installed")
    for name, left in left_out.items():
        yield Finding(f"task {name}", False, str(left), _FIX, needed=left.plugin in FIRST_PARTY)


def _sandbox() -> Finding:
    from gap_cli.sandbox import level

    have = level()
    hint = "" if have != "none" else "Builder code will be refused; --unsafe-no-sandbox runs it all the same."
    return Finding("sandbox", have != "none", have, hint)


def _torch() -> Finding:
    """Which build torch is, read from its files: importing it takes seconds."""
    spec = importlib.util.find_spec("torch")
    if spec is None or spec.origin is None:
        return Finding("torch", False, "not installed", "make setup, or pip install torch (the CPU build).")
    text = (Path(spec.origin).parent / "version.py").read_text(encoding="utf-8")
    cuda = re.search(r"^cuda.*=\s*['\"](.+)['\"]", text, re.MULTILINE)
    version = metadata.version("torch")
    if cuda is None:
        return Finding("torch", True, f"{version}, CPU build")
    return Finding("torch", True, f"{version}, CUDA {cuda[1]} build", "Works; the CPU build is gigabytes smaller.")


def _extras() -> Iterator[Finding]:
    for name, (what, do) in EXTRAS.items():
        there = _installed(name)
        found = f"{metadata.version(name)}: {what}" if there else what
        yield Finding(name, there, found, "" if there else do, needed=False)


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def _disk(root: Path) -> Finding:
    folder = next(p for p in (root.absolute(), *root.absolute().parents) if p.exists())
    free = shutil.disk_usage(folder).free // 1_000_000
    if not os.access(folder, os.W_OK):
        return Finding("disk", False, f"{folder} cannot be written", "Choose another folder with --root.")
    hint = "" if free >= NEEDED_MB else f"Recordings need room; keep {NEEDED_MB} MB free."
    return Finding("disk", free >= NEEDED_MB, f"{free} MB free for {root}/", hint)
