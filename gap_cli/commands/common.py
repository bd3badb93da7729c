"""What every verb shares: its options, how it prints, and the next-step hint."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from gap_cli.workspace.run import Run


def complete_run(incomplete: str) -> list[str]:
    """Names of runs below runs/, for shell completion."""
    root = Path("runs")
    return sorted(p.parent.name for p in root.glob("*/run.yaml") if p.parent.name.startswith(incomplete))


def complete_task(incomplete: str) -> list[str]:
    """Names of installed tasks, for shell completion."""
    from gap_cli.workspace.tasks import find_tasks
    from gap_runtime.plugins import load_registry

    return [name for name in find_tasks(load_registry()) if name.startswith(incomplete)]


RunName = Annotated[
    str | None,
    typer.Argument(
        metavar="RUN",
        help="A run's name or folder, a folder that holds workflow.json, or that file; the latest run when left out.",
        autocompletion=complete_run,
    ),
]
TaskOf = Annotated[
    str | None,
    typer.Option(
        "--task",
        "-t",
        metavar="NAME[:VARIANT]",
        help="The task of a graph from elsewhere; noted in a run.yaml beside it.",
        autocompletion=complete_task,
    ),
]
Skills = Annotated[
    list[Path] | None,
    typer.Option(
        "--skills", metavar="PATH", envvar="GAP_SKILLS_PATH", exists=True, file_okay=False,
        help="A skill, or a folder of skills, beside the installed ones. Recorded in the run.",
    ),
]  # fmt: skip
Root = Annotated[Path, typer.Option(help="The folder that holds the runs.", envvar="GAP_RUNS", show_default=True)]
AsJson = Annotated[bool, typer.Option("--json", help="Print data as JSON and nothing else on stdout.")]
RUNS = Path("runs")
NARROW = 60  # columns below which a table of several columns cannot be read


def console() -> Console:
    """Where people read: stdout, honouring NO_COLOR, dumb terminals and COLUMNS; 100 columns where nobody watches."""
    from rich.console import Console

    return Console(highlight=False, width=None if sys.stdout.isatty() else _columns() or 100)


def print_json(data: Any) -> None:
    """`data` as one JSON document on stdout."""
    from gap_cli.workspace.canonical import plain

    typer.echo(json.dumps(plain(data), ensure_ascii=False, indent=2))


def print_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """A plain table that folds long cells instead of cutting them; on a narrow terminal, one line per cell."""
    from rich.table import Table
    from rich.text import Text

    out = console()
    if out.width < NARROW:
        _print_cells(title, columns, rows)
        return
    table = Table(title=title or None, title_justify="left", header_style="bold", box=None, pad_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(str(cell)) for cell in row))
    out.print(table)


def _print_cells(title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Every filled cell on lines of its own, a blank line after each row."""
    out = console()
    if title:
        out.print(title, markup=False)
    for row in rows:
        for column, cell in zip(columns, map(str, row), strict=False):
            if cell.strip():
                out.print(f"{column}: {cell}" if column else cell, markup=False)
        out.print()


def open_run(root: Path, name: str | None, skills: list[Path] | None, task: str | None = None) -> Run:
    """The run, `skills` and the `task` of a bare folder recorded in it. Raises `RunError`, `StorageError`."""
    from gap_cli.workspace.run import Run

    return Run.open(root, name, task).with_skills(skills or ())


def print_done(run: Run, stage: str, lines: Iterable[str], *, next_step: str = "") -> None:
    """What a verb made, where it is, and what to type next."""
    out = console()
    for line in lines:
        out.print(line, markup=False, soft_wrap=True)
    out.print(f"{stage or 'run'}: {run.folder(stage)}", markup=False, soft_wrap=True, style="dim")
    if next_step:
        out.print(f"next:  {next_step}", markup=False, soft_wrap=True, style="bold")


def _columns() -> int:
    text = os.environ.get("COLUMNS", "")
    return int(text) if text.isdigit() else 0
