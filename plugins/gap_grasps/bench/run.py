"""`gap bench grasps`: the whole measurement on held-out seeds, in worker processes, as one table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from gap_grasps.bench.execution import GENERATORS
from gap_grasps.bench.grasps import DRAWN, Rank, grasp_rows
from gap_grasps.bench.objects import bench_task, subjects
from gap_grasps.bench.report import report
from gap_grasps.bench.sampling import pool_of
from gap_grasps.bench.sheet import sheet, worst
from gap_grasps.surface import thinned
from gap_runtime.contracts.bench import BenchContext, BenchReport

HELD_OUT = 10_000  # seeds from here on are never used to improve anything
SCENES = 40  # per object, half of them lying where it can: 400 groceries tell 0.97 to 1.7 points
DRAWS = 4  # per scene, of any score
CHUNK = 10  # scenes per job
TASK = "fulfill-grocery"  # whose cell and groceries are used
PICTURED = 0.006  # m between the points of a cloud in the picture
UNSHARED = ("cell", "seen", "pose")  # parts of a row that only the worker that made it can use
Row = dict[str, Any]


class GraspJob(NamedTuple):
    """Scenes of one object for one worker."""

    name: str
    seeds: range
    generators: tuple[str, ...]
    draws: int


def run(bench: BenchContext) -> BenchReport:
    """Success by generator and object, and by score."""
    first = HELD_OUT if bench.seed is None else bench.seed
    seeds = range(first, first + (bench.n or SCENES))
    rows = measured(bench, jobs(bench, seeds, tuple(GENERATORS), DRAWS))
    gripper = bench.robot(bench.task(TASK).robots[0].model).gripper
    return report(rows, first, (sheet(worst(rows), gripper),))


def jobs(bench: BenchContext, seeds: range, generators: tuple[str, ...], draws: int) -> list[GraspJob]:
    """Every object over all seeds, in pieces short enough to share out evenly."""
    names = [s.name for s in subjects(bench_task(bench.task(TASK)))]
    pieces = [seeds[i : i + CHUNK] for i in range(0, len(seeds), CHUNK)]
    return [GraspJob(name, piece, generators, draws) for piece in pieces for name in names]


def measured(
    bench: BenchContext, work: list[GraspJob], measure: Callable[[BenchContext, GraspJob], list[Row]] | None = None
) -> list[Row]:
    """All rows, in the order of the jobs, whichever worker did them."""
    return [row for found in bench.map(measure or job_rows, work, lambda job: job.name) for row in found]


def job_rows(bench: BenchContext, job: GraspJob) -> list[Row]:
    """The rows of one job; of drawn grasps also what a picture needs."""
    found = []
    for row in rows_of(bench, job):
        shared = {k: v for k, v in row.items() if k not in UNSHARED}
        if row["generator"] == DRAWN:
            cloud = thinned(row["seen"].target, PICTURED).astype("float32")
            shared |= {"pose": row["pose"].matrix, "cloud": cloud}
        found.append(shared)
    return found


def rows_of(bench: BenchContext, job: GraspJob, pool: Rank = pool_of) -> Iterator[Row]:
    """Of one object."""
    task = bench_task(bench.task(TASK))
    return grasp_rows(bench, task, job.name, job.seeds, generators=job.generators, draws=job.draws, pool=pool)
