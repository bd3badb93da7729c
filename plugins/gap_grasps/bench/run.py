"""`gap bench grasps`: the whole measurement on held-out seeds, in worker processes, as one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from gap_grasps.bench.execution import GENERATORS
from gap_grasps.bench.grasps import DRAWN, Rank, grasp_rows
from gap_grasps.bench.objects import bench_task, subjects
from gap_grasps.bench.report import report
from gap_grasps.bench.sampling import pool_of
from gap_grasps.bench.sheet import sheet, worst
from gap_grasps.surface import thinned
from gap_runtime.contracts.bench import BenchReport, Progress
from gap_runtime.contracts.task import Task, load_task
from gap_runtime.contracts.tool import Tool

HELD_OUT = 10_000  # seeds from here on are never used to improve anything
SCENES = 40  # per object, half of them lying where it can: 400 groceries tell 0.97 to 1.7 points
DRAWS = 4  # per scene, of any score
CHUNK = 10  # scenes per job
WORKERS = 2
TASK = "fulfill-grocery"  # whose cell and groceries are used
PICTURED = 0.006  # m between the points of a cloud in the picture
UNSHARED = ("cell", "seen", "pose")  # parts of a row that only the worker that made it can use
Row = dict[str, Any]
Job = tuple[str, range, tuple[str, ...], int]


def run(progress: Progress) -> BenchReport:
    """Success by generator and object, and by score."""
    from gap_robots.panda import panda

    rows = measured(jobs(range(HELD_OUT, HELD_OUT + SCENES), tuple(GENERATORS), DRAWS), progress)
    return report(rows, (sheet(worst(rows), panda().gripper),))


def jobs(seeds: range, generators: tuple[str, ...], draws: int) -> list[Job]:
    """Every object over all seeds, in pieces short enough to share out evenly."""
    names = [s.name for s in subjects(bench_task(task()))]
    return [(name, seeds[i : i + CHUNK], generators, draws) for i in range(0, len(seeds), CHUNK) for name in names]


def measured(
    work: list[Job], progress: Progress, measure: Callable[[Job], list[Row]] | None = None
) -> list[Row]:  # fmt: skip
    """All rows, in the order of the jobs, whichever worker did them."""
    done: dict[int, list[Row]] = {}
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(measure or job_rows, job): i for i, job in enumerate(work)}
        for future in as_completed(running):
            index = running[future]
            done[index] = future.result()
            progress(len(done) / len(work), work[index][0])
    return [row for index in sorted(done) for row in done[index]]


def job_rows(job: Job) -> list[Row]:
    """The rows of one job; of drawn grasps also what a picture needs."""
    found = []
    for row in rows_of(*job):
        shared = {k: v for k, v in row.items() if k not in UNSHARED}
        if row["generator"] == DRAWN:
            cloud = thinned(row["seen"].target, PICTURED).astype("float32")
            shared |= {"pose": row["pose"].matrix, "cloud": cloud}
        found.append(shared)
    return found


def rows_of(
    name: str, seeds: Iterable[int], generators: tuple[str, ...], draws: int, pool: Rank = pool_of
) -> Iterator[Row]:
    """Of one object."""
    from gap_mujoco.simulator import MujocoSimulator
    from gap_robots.panda import panda

    yield from grasp_rows(
        task(), {"panda": panda()}, tools(), seeds, MujocoSimulator,
        names=(name,), generators=generators, draws=draws, pool=pool,
    )  # fmt: skip


def tools() -> dict[str, Tool]:
    """What looks, plans and moves here: the embedded providers."""
    from gap_geometry import boxes, clouds, grasps
    from gap_grasps import tools as ours
    from gap_motion.tools import control as tools_control
    from gap_motion.tools import gripper as tools_gripper
    from gap_motion.tools import pyroki as tools_pyroki
    from gap_perception import observation

    modules = (ours, boxes, clouds, grasps, tools_control, tools_gripper, tools_pyroki, observation)
    return {tool.spec.name: tool for module in modules for tool in module.TOOLS}


def task() -> Task:
    """The task whose cell it is."""
    from gap_tasks import tasks_folder

    return load_task(tasks_folder() / TASK)
