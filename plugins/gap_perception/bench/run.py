"""`gap bench perception`: the skill's own way from frames to a box, on held-out random scenes, in worker processes."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from gap_perception.bench.perception import CLEAN, Perceive, level_task, levels_of, measure
from gap_perception.bench.pictures import Case, sheet, worst
from gap_perception.bench.report import report
from gap_runtime.contracts.bench import BenchReport, Picture, Progress
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.task import Task, load_task
from gap_runtime.contracts.tool import Tool
from gap_runtime.contracts.types import CameraObservation, Mask, OrientedBoundingBox

HELD_OUT = 10_000  # seeds from here on are never used to improve anything
SCENES = {CLEAN: 500}
FEWER_SCENES = 150  # at any other level
CHUNK = 10  # scenes per job
WORKERS = 2
TASK = "fulfill-grocery"  # whose cell, groceries and sensors are used
SKILL = "perception-single"
PICTURED = (CLEAN, "realistic")
Row = dict[str, Any]


class Job(NamedTuple):
    """Scenes of one noise level for one worker to measure."""

    level: str
    first: int
    scenes: int


def run(progress: Progress) -> BenchReport:
    """Every noise level over its scenes."""
    levels = levels_of(_task())
    return measure_levels({level: SCENES.get(level, FEWER_SCENES) for level in levels}, HELD_OUT, progress)


def measure_levels(scenes: Mapping[str, int], first: int, progress: Progress, workers: int = WORKERS) -> BenchReport:
    """So many scenes of each level, from seed `first` on."""
    jobs = [
        Job(level, first + start, min(CHUNK, count - start))
        for level, count in scenes.items()
        for start in range(0, count, CHUNK)
    ]
    rows: list[Row] = []
    cases: dict[str, list[Case]] = {level: [] for level in PICTURED if level in scenes}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_one_core) as pool:
        for done, (job, (found, bad)) in enumerate(zip(jobs, pool.map(measure_job, jobs), strict=True)):
            progress((done + 1) / len(jobs), f"{job.level} sensor")
            rows += [{"sensor": job.level, **row} for row in found]
            cases.get(job.level, []).extend(bad)
    models = {name: model for name, model in _task().sensors.models.items() if name in scenes}
    return report(rows, models, _pictures(rows, cases), first)


def _pictures(rows: Sequence[Row], cases: Mapping[str, Sequence[Case]]) -> tuple[Picture, ...]:
    if not cases:
        return ()
    searches = {level: sum(row["sensor"] == level for row in rows) for level in cases}
    return (Picture("The worst cases", ".jpg", sheet(cases, searches)),)


def measure_job(job: Job) -> tuple[list[Row], list[Case]]:
    """The job's rows, and its worst cases. Runs in a worker."""
    cell, perceive, fresh = _cell(job.level), skill_way(), not _warm
    rows, cases = worst(measure(cell, perceive, range(job.first, job.first + job.scenes)))
    if fresh:
        # The first scene of a process pays for loading libraries, which is no frame's time.
        _warm.append(True)
        rows = [row | {"ms": None} if row["seed"] == job.first else row for row in rows]
    return rows, cases


_warm: list[bool] = []
_made: dict[str, Any] = {}  # what providers derive from the models, the same at every level


@cache
def _cell(level: str) -> StandaloneContext:
    """This process's cell of a noise level; processes end without closing it."""
    from gap_mujoco.simulator import MujocoSimulator
    from gap_perception.bench.scenes import SCENE
    from gap_robots.panda import panda

    task, robots = level_task(_task(), level), {"panda": panda()}
    return StandaloneContext(MujocoSimulator(task, SCENE, robots), task, robots, _tools(), made=_made)


def _one_core() -> None:
    """Times are of one core; the other one has a worker of its own."""
    import cv2
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    cv2.setNumThreads(1)
    threadpool_limits(1)


@cache
def skill_way() -> Perceive:
    """How the skill perceives: its canonical script, then the noise filter and the box."""
    import morsl

    folder = Path(morsl.__file__).parent / SKILL
    spec = importlib.util.spec_from_file_location(
        "gap_perception_bench_script", folder / "scripts/perceive_dino_vlm.py"
    )
    assert spec is not None and spec.loader is not None
    script = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    prompt = (folder / "prompts/select_box.md").read_text()

    def perceive(
        cell: StandaloneContext, cameras: list[CameraObservation], label: str
    ) -> tuple[OrientedBoundingBox, Mask]:
        found = script.run(cell, cameras, label, prompt)
        return cell.tool("geometry_svc.FilterAndComputeOBB", point_cloud=found.cloud), found.mask

    return perceive


def _tools() -> dict[str, Tool]:
    from gap_geometry import boxes, clouds
    from gap_perception import detect, observation, segment
    from gap_perception.language import tools as language

    modules = (boxes, clouds, detect, language, observation, segment)
    return {tool.spec.name: tool for module in modules for tool in module.TOOLS}


def _task() -> Task:
    from gap_tasks import tasks_folder

    return load_task(tasks_folder() / TASK)
