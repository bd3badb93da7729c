"""`gap run`: run the graph once, in the simulator or dry, and keep what happened."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gap_cli.commands.common import (
    RUNS,
    AsJson,
    Root,
    RunName,
    Skills,
    TaskOf,
    console,
    open_run,
    print_done,
    print_json,
)

if TYPE_CHECKING:
    from gap_runtime.run.events import Event

MARKS = {"node_finished": ("✓", "green"), "node_failed": ("✗", "red"), "node_cancelled": ("–", "yellow")}


def run(
    run: RunName = None,
    task: TaskOf = None,
    seed: Annotated[int | None, typer.Option(min=0, help="The instance; the run's own seed when left out.")] = None,
    dry: Annotated[bool, typer.Option("--dry", help="Without a world: outputs are made up from their types.")] = False,
    substitute: Annotated[
        Path | None, typer.Option(metavar="RULES.yaml", help="Replace nodes or tools by mocks and injected faults.")
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="Record the first camera for `gap view`.")] = False,
    skills: Skills = None,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Run the graph once. Exit 0 where it succeeded, 1 where it did not, 130 where it was interrupted."""
    from gap_cli.rehearse.single_run import run_once

    opened = open_run(root, run, skills, task)
    with opened.held():
        ended = run_once(
            opened, seed=seed, dry=dry, rules=substitute, video=video, observers=[] if json else [print_event]
        )
    if json:
        print_json({"run": opened.name, "path": str(ended.folder), "result": ended.data})
    else:
        reason = ended.data.get("error") or ended.data.get("reason") or ""
        status = f"{'dry run' if dry else 'run'}: {ended.data['status']}" + (f": {reason}" if reason else "")
        print_done(opened, "run", [status], next_step=f"gap view {opened.argument}")
    if not ended.success:
        raise typer.Exit(130 if ended.cancelled else 1)


def print_event(event: Event) -> None:
    """A line for every node that ends and every subgraph that is left."""
    out = console()
    if event.kind in MARKS:
        mark, colour = MARKS[event.kind]
        error = f"  {event.data['error']}" if event.data.get("error") else ""
        out.print(f"  [{colour}]{mark}[/] ", end="")
        out.print(f"{event.path}  {event.data['duration_s']:.2f} s{error}", markup=False, soft_wrap=True)
    elif event.kind == "subgraph_exited":
        out.print(f"{event.path} -> {event.data['exit']}", style="bold", markup=False)
    elif event.kind == "recovery_started":
        out.print(f"recovery of {event.path}", style="yellow", markup=False)
