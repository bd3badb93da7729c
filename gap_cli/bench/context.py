"""What the host gives to a benchmark: the registry's things, and worker processes that have them too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from gap_cli.skills.library import load_library
from gap_cli.workspace.tasks import open_task
from gap_runtime.contracts.bench import Job, Progress, Result
from gap_runtime.errors import UnknownNameError
from gap_runtime.plugins import Registry, load_registry

if TYPE_CHECKING:
    from gap_runtime.contracts.bench import BenchContext
    from gap_runtime.contracts.robot import RobotSpec
    from gap_runtime.contracts.simulator import Simulator
    from gap_runtime.contracts.task import Task
    from gap_runtime.contracts.task.rendering import ObjectRenderer
    from gap_runtime.contracts.tool import Tool


def quiet(done: float, what: str) -> None:
    """Nobody watches."""


@dataclass
class BenchRun:
    """A `contracts.bench.BenchContext` over a registry."""

    registry: Registry
    n: int | None = None
    seed: int | None = None
    workers: int = 1
    watch: Progress = quiet
    tools: Mapping[str, Tool] = field(init=False)
    renderer: ObjectRenderer | None = field(init=False)

    def __post_init__(self) -> None:
        self.tools, self.renderer = self.registry.tools, self.registry.renderer

    def progress(self, done: float, what: str) -> None:
        """Tell whoever watches."""
        self.watch(done, what)

    def robot(self, name: str) -> RobotSpec:
        """A robot's spec."""
        return self.registry.robot(name)

    def task(self, name: str) -> Task:
        """A task without a variant."""
        return open_task(self.registry, name)

    def skill(self, name: str) -> Path:
        """A skill's folder."""
        library = load_library(self.registry.skill_paths)
        if name not in library:
            raise UnknownNameError("skill", name, library)
        return library[name].path

    def simulator(self, task: Task, scene: str) -> Simulator:
        """By the cell that the task names."""
        name = task.environment.simulator
        if name not in self.registry.cells:
            raise UnknownNameError("simulator", name, self.registry.cells)
        robots = {placed.model: self.robot(placed.model) for placed in task.robots}
        made: Simulator = self.registry.cells[name].value(task, scene, robots)
        return made

    def map(
        self, measure: Callable[[BenchContext, Job], Result], jobs: Sequence[Job], label: Callable[[Job], str] = str
    ) -> list[Result]:
        """In `workers` processes, each with a registry of its own; one worker is this process."""
        done: dict[int, Result] = {}
        if self.workers == 1:
            for index, job in enumerate(jobs):
                share = _Share(self.watch, index, len(jobs))
                done[index] = measure(replace(self, watch=share), job)
                self.progress((index + 1) / len(jobs), label(job))
            return list(done.values())
        with ProcessPoolExecutor(self.workers, get_context("spawn"), _begin, (self.n, self.seed)) as pool:
            running = {pool.submit(_measure, measure, job): i for i, job in enumerate(jobs)}
            for future in as_completed(running):
                index = running[future]
                done[index] = future.result()
                self.progress(len(done) / len(jobs), label(jobs[index]))
        return [done[index] for index in sorted(done)]


@dataclass(frozen=True)
class _Share:
    """The progress of one of several jobs as progress of all."""

    watch: Progress
    index: int
    count: int

    def __call__(self, done: float, what: str) -> None:
        self.watch((self.index + done) / self.count, what)


_WORKER: list[BenchRun] = []


def _begin(n: int | None, seed: int | None) -> None:
    """Make this worker's context; times are of one core, since the others have workers of their own."""
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    threadpool_limits(1)
    _WORKER.append(BenchRun(load_registry(), n, seed))


def _measure(measure: Callable[[BenchContext, Job], Result], job: Job) -> Result:
    return measure(_WORKER[0], job)
