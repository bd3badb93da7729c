"""What a benchmark is called with, and what it gives: one table, with what is needed to believe it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer
from gap_runtime.contracts.tool import Tool

Job = TypeVar("Job")
Result = TypeVar("Result")

Progress = Callable[[float, str], None]
"""(how much is done, 0 to 1; what is being measured now)."""


@dataclass(frozen=True)
class Table:
    """A further table of a report."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture beside a report: what it shows, and an encoded image with its `suffix` (".jpg", ".png")."""

    caption: str
    suffix: str
    data: bytes


@dataclass(frozen=True)
class BenchReport:
    """A benchmark's result: a table, and any more of them. `notes` say how it was measured; `packages` are
    distributions whose version matters; `pictures` show what no number does."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    notes: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    more: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


class BenchContext(Protocol):
    """How much to measure, and what the plugins offer to measure it with."""

    n: int | None  # how many samples were asked for; None: the benchmark's own number
    seed: int | None  # of the first sample; None: the benchmark's own
    workers: int  # processes that `map` uses
    tools: Mapping[str, Tool]  # by name, as `gap tools list` shows them
    renderer: ObjectRenderer | None  # of object models, where a plugin offers one

    def progress(self, done: float, what: str) -> None:
        """How much is done, 0 to 1, and what is being measured now."""

    def robot(self, name: str) -> RobotSpec:
        """A robot. Raises `UnknownNameError`."""

    def task(self, name: str) -> Task:
        """A task. Raises `UnknownNameError`, `DocumentError`."""

    def skill(self, name: str) -> Path:
        """The folder of a skill. Raises `UnknownNameError`."""

    def simulator(self, task: Task, scene: str) -> Simulator:
        """A new simulator of the task's cell; whoever asked for it closes it."""

    def map(
        self, measure: Callable[[BenchContext, Job], Result], jobs: Sequence[Job], label: Callable[[Job], str] = str
    ) -> list[Result]:
        """What `measure(context, job)` gives for each job, in their order, measured in worker processes.

        `measure` is a function of a module, jobs and results can be pickled. Progress is told by jobs that are done.
        """


def standalone(bench: BenchContext, task: Task, scene: str, seed: int = 0) -> StandaloneContext:
    """A cell outside any graph, with all of a benchmark's tools."""
    robots = {placed.model: bench.robot(placed.model) for placed in task.robots}
    return StandaloneContext(bench.simulator(task, scene), task, robots, bench.tools, seed, bench.renderer)


Benchmark = Callable[[BenchContext], BenchReport]
