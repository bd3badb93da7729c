"""Where rehearsals run: an engine is handed a job and seeds, and reports every episode it finished or lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any, Protocol


@dataclass(frozen=True)
class RehearsalJob:
    """What a worker needs to roll episodes out; everything else is read from the folder `run`.

    `run` holds a GraphBundle and run.yaml, and stays as it is while the job lasts; `output` is where frames and logs
    go. `record` asks for an MCAP of every episode; `frames` for a picture of its first and last instant. An episode
    that takes longer than `wall_limit_s` of wall time is given up as hung.
    """

    run: Path
    output: Path
    record: bool = False
    frames: bool = True
    wall_limit_s: float = 600.0


@dataclass(frozen=True)
class EpisodeResult:
    """One episode: its canonical `row`, and its `timing`, which holds everything that depends on wall time."""

    seed: int
    row: Mapping[str, Any]
    timing: Mapping[str, Any] = field(default_factory=dict)


class Engine(Protocol):
    """Rolls out episodes, each as if alone in a fresh world."""

    def run(
        self, job: RehearsalJob, seeds: Sequence[int], report: Callable[[EpisodeResult], None], stop: Event
    ) -> None:
        """Roll out every seed and report each once, in any order, from the calling thread.

        A worker that crashes, hangs or runs out of memory costs the episode it had, which is reported as lost, and is
        replaced. Once `stop` is set no new episode starts; those under way are finished. Raises `GapError` when no
        worker can be started.
        """
