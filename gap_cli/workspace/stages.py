"""Which file a stage leaves behind, what to type when a verb comes too early, and how a stage is written whole."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

from gap_cli.workspace.atomic import replace_files
from gap_cli.workspace.canonical import text_bytes
from gap_cli.workspace.run import Run
from gap_runtime.bundle.bundle import WORKFLOW
from gap_runtime.errors import RunError

PRODUCT = {
    "plan": "plan/plan.json",
    "generate": "generate/workflow.json",
    "validate": "validate/findings.json",
    "rehearse": "rehearse/00/summary.json",
}


def product(run: Run, stage: str) -> Path:
    """The file that `stage` leaves behind. Raises `RunError` with what to type when it is not there."""
    path = run.graph_folder / WORKFLOW if stage == "generate" else run.path / PRODUCT[stage]
    if not path.is_file():
        command = 'plan --task TASK --say "..."' if stage == "plan" else f"{stage} {run.argument}"
        raise RunError(f"Run {run.name} has no {PRODUCT[stage]} yet.", hint=f"Type: gap {command}")
    return path


def write_stage(run: Run, stage: str, files: Mapping[str, str], *, keep: tuple[str, ...] = ()) -> list[Path]:
    """Make the stage's folder hold exactly `files` (relative path -> text): all new, or all as before.

    Files there that are not in `files` are removed, except where their name ends with one of `keep`. Returns what
    changed. Raises `StorageError`.
    """
    folder = run.folder(stage)
    wanted = {folder / name: text_bytes(text) for name, text in files.items()}
    there = [p for p in folder.rglob("*") if p.is_file()] if folder.is_dir() else []
    stale = [p for p in there if p not in wanted and not p.name.endswith(keep or ("\0",))]
    changed = replace_files(wanted, remove=stale)
    for path in sorted((p for p in folder.rglob("*") if p.is_dir()), reverse=True):
        if not any(path.iterdir()):
            path.rmdir()
    return changed


def digest(path: Path) -> str:
    """sha256 of a file's bytes, in hex."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def folder_digest(folder: Path) -> str:
    """sha256 over the names and bytes of every file below `folder`."""
    total = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts):
        total.update(f"{path.relative_to(folder).as_posix()}\0{digest(path)}\n".encode())
    return total.hexdigest()
