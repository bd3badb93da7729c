"""`gap rehearse`: roll the graph out on sampled instances and say how reliable it is."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import (
    RUNS,
    AsJson,
    Root,
    RunName,
    Skills,
    TaskOf,
    open_run,
    print_done,
    print_json,
    print_table,
)
from gap_cli.commands.error_handler import say as say_line
from gap_runtime.errors import GapError

if TYPE_CHECKING:
    from gap_cli.rehearse.evaluate import Evaluation
    from gap_cli.workspace.run import Run
    from gap_runtime.contracts.engine import EpisodeResult

Progress = Callable[["EpisodeResult"], None]
Say = Callable[[str], None]


class Recorded(StrEnum):
    """Which episodes get an MCAP."""

    failed = "failed"
    all = "all"
    none = "none"


Episodes = Annotated[int, typer.Option("-n", "--episodes", min=1, max=100_000, help="How many instances.")]
Workers = Annotated[int, typer.Option("--workers", "-w", min=1, max=256, help="Worker processes.")]
Seed = Annotated[int | None, typer.Option(min=0, help="First instance seed; the run's own when left out.")]
Record = Annotated[Recorded, typer.Option(help="Which episodes to record as MCAP for Foxglove.")]


def rehearse(
    run: RunName = None,
    task: TaskOf = None,
    n: Episodes = 10,
    seed: Seed = None,
    workers: Workers = 2,
    record: Record = Recorded.failed,
    engine: Annotated[str, typer.Option(help="Where episodes run.")] = "local",
    skills: Skills = None,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Roll out N instances, seeds SEED to SEED+N-1, and write episodes, summary and feedback."""
    opened = open_run(root, run, skills, task)
    found = rehearse_run(opened, n, seed, workers, record, engine)
    if json:
        path = str(opened.folder("rehearse/00"))
        print_json({"run": opened.name, "path": path, "summary": found.summary, "clock": found.clock})
    else:
        print_evaluation(found)
        print_done(opened, "rehearse/00", [], next_step=f"gap report {opened.argument}")
    raise_for(found)


def rehearse_run(
    run: Run, n: int, seed: int | None, workers: int, record: Recorded, engine: str = "local"
) -> Evaluation:
    """Rehearse with a progress bar on stderr."""
    from gap_cli.rehearse.rehearsal import rehearse as roll_out

    with run.held(), episode_progress(n) as (progress, say):
        return roll_out(run, n, seed, workers, record.value, engine=engine, progress=progress, say=say)


def print_evaluation(found: Evaluation) -> None:
    """The rate with its interval, the table of subgraphs, and the times."""
    from gap_cli.commands.common import console
    from gap_cli.rehearse.summary import rate_of

    data, clock = found.summary, found.clock
    rows = [
        (s["node"], s["skill"], f"{s['validation']['passed']}/{s['validation']['of']}", _exits(s))
        for s in data["subgraphs"]
    ]
    print_table("", ("subgraph", "skill", "checks passed", "exits"), rows)
    out = console()
    out.print(f"\nsuccess     {rate_of(data)}", style="bold", markup=False)
    if data["void"]:
        lost = ", ".join(f"{n} {status}" for status, n in data["void"].items())
        out.print(f"void        {lost} (counted as failures)", style="red", markup=False)
    if data["partial"]:
        out.print(f"partial     {data['episodes']} of {data['asked']} episodes", style="red", markup=False)
    out.print(f"cycle time  {_spread(clock['cycle_s'])} = motion {_spread(clock['motion_s'])}"
              f" + compute {_spread(clock['compute_s'])}", markup=False, soft_wrap=True)  # fmt: skip
    out.print(f"wall time   {_spread(clock['wall_s'])} per episode", markup=False)
    for group in data["failures"][:5]:
        out.print(f"{group['count']:>4} x {group['stage'] or '-'}: {group['reason']}", markup=False, soft_wrap=True)


def raise_for(found: Evaluation) -> None:
    """Exit 130 where the rehearsal was interrupted, 1 with an error where no episode says anything about the graph."""
    if found.interrupted:
        raise typer.Exit(130)
    if not found.measured:
        reasons = "; ".join(f"{g['count']} x {g['reason']}" for g in found.summary["failures"][:3])
        raise GapError(
            f"Nothing was measured: all {len(found.rows)} episodes are void ({reasons}).",
            hint="What the workers printed is in rehearse/00/worker-*.log.",
        )


def _exits(subgraph: Any) -> str:
    return ", ".join(f"{name} {count}" for name, count in subgraph["exits"].items())


def _spread(values: Any) -> str:
    if values["median"] is None:
        return "-"
    return f"{values['median']:.1f} s (p90 {values['p90']:.1f})"


@contextmanager
def episode_progress(total: int) -> Iterator[tuple[Progress, Say]]:
    """What to call with each finished episode, and with each remark: a progress bar on stderr where someone watches, a
    line per episode where no one does."""
    if not sys.stderr.isatty():
        yield _plain(total), say_line
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("episodes", total=total)
        won = [0]

        def progress(result: EpisodeResult) -> None:
            won[0] += bool(result.row["success"])
            bar.update(task, advance=1, description=f"episodes, {won[0]} succeeded")

        yield progress, lambda text: bar.console.print(text, markup=False)


def _plain(total: int) -> Progress:
    done = [0]

    def progress(result: EpisodeResult) -> None:
        done[0] += 1
        row = result.row
        ending = "success" if row["success"] else f"{row['status']}: {row['reason']}"
        say_line(f"[{done[0]}/{total}] seed {result.seed}: {ending}")

    return progress
