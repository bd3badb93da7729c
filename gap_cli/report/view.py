"""Draws a run's graph, with what happened in its last `gap run` where there was one."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gap_cli.render.mermaid import mermaid
from gap_cli.render.page import page
from gap_cli.render.timeline import STAGE, TRACE, RunTimeline, read_timeline
from gap_cli.workspace.canonical import write_text
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import product
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.graph.load import load_workflow
from gap_runtime.graph.model import Workflow

if TYPE_CHECKING:
    from rich.tree import Tree

PAGE, MERMAID = "view.html", "graph.mmd"


@dataclass(frozen=True)
class View:
    """A graph ready to be shown. `sources` holds its scripts by path."""

    run: Run
    workflow: Workflow
    sources: dict[str, str]
    timeline: RunTimeline | None
    film: tuple[Path, float] | None

    @property
    def mermaid(self) -> str:
        """As Mermaid text."""
        return mermaid(self.workflow)

    def tree(self) -> Tree:
        """As a tree for the terminal."""
        from gap_cli.render.tree import tree

        return tree(self.workflow, self.timeline)

    def write(self) -> list[Path]:
        """Write view.html and graph.mmd beside the run. Raises `StorageError`."""
        video, began = self.film or (None, 0.0)
        title = f"{self.run.name}: {self.run.config.instruction}"
        html = page(self.workflow, self.sources, self.timeline, title=title, video=video, video_start=began)
        files = {self.run.path / PAGE: html, self.run.path / MERMAID: self.mermaid}
        for file, text in files.items():
            write_text(file, text)
        return list(files)


def read_view(run: Run) -> View:
    """Read the graph of `run` and the trace of its last `gap run`. Raises `RunError`, `DocumentError`."""
    file = product(run, "generate")
    workflow = load_workflow(file)
    rows = _rows(run.folder(STAGE) / TRACE)
    film = rows[0].get("film") if rows else None
    return View(
        run, workflow, _sources(workflow, file.parent), read_timeline(rows) if rows else None,
        (run.folder(STAGE) / film["video"], float(film["began"])) if film else None,
    )  # fmt: skip


def _rows(file: Path) -> list[dict[str, Any]]:
    if not file.is_file():
        return []
    try:
        return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    except (ValueError, OSError) as error:
        raise DocumentError(str(file), f"is not a trace ({error})", hint="Delete it, or type: gap run") from None


def _sources(workflow: Workflow, folder: Path) -> dict[str, str]:
    paths = {n.script for d in workflow.subgraphs.values() for n in d.nodes.values() if n.script}
    return {path: read_text(folder / path) for path in sorted(paths) if (folder / path).is_file()}
