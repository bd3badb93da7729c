"""A progress bar on stderr where someone watches, a line per episode where no one does."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from gap_cli.commands.error_handler import say as say_line

if TYPE_CHECKING:
    from gap_runtime.contracts.engine import EpisodeResult

Progress = Callable[["EpisodeResult"], None]
Say = Callable[[str], None]


@contextmanager
def episode_progress(total: int) -> Iterator[tuple[Progress, Say]]:
    """What to call with each finished episode, and with each remark."""
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
