"""`gap bench perception`: the skill's own way from frames to a box, on held-out random scenes, in worker processes."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from gap_perception.bench.perception import CLEAN, Perceive, level_task, levels_of, measure
from gap_perception.bench.pictures import Case, sheet, worst
from gap_perception.bench.report import report
from gap_perception.bench.scenes import SCENE
from gap_runtime.contracts.bench import BenchContext, BenchReport, Picture, standalone
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.types import CameraObservation, Mask, OrientedBoundingBox

HELD_OUT = 10_000  # seeds from here on are never used to improve anything
SCENES = 500  # of perfect cameras
SHARE = 0.3  # as many of those at any other noise level
CHUNK = 10  # scenes per job
TASK = "fulfill-grocery"  # whose cell, groceries and sensors are used
SKILL = "perception-single"
PICTURED = (CLEAN, "realistic")
Row = dict[str, Any]


class ScenesJob(NamedTuple):
    """Scenes of one noise level for one worker to measure."""

    level: str
    first: int
    scenes: int


def run(bench: BenchContext) -> BenchReport:
    """Every noise level over its scenes."""
    task, first, count = bench.task(TASK), HELD_OUT if bench.seed is None else bench.seed, bench.n or SCENES
    scenes = {level: count if level == CLEAN else max(1, round(SHARE * count)) for level in levels_of(task)}
    jobs = [
        ScenesJob(level, first + start, min(CHUNK, count - start))
        for level, count in scenes.items()
        for start in range(0, count, CHUNK)
    ]
    rows: list[Row] = []
    cases: dict[str, list[Case]] = {level: [] for level in PICTURED if level in scenes}
    for job, (found, bad) in zip(jobs, bench.map(measure_job, jobs, lambda job: f"{job.level} sensor"), strict=True):
        rows += [{"sensor": job.level, **row} for row in found]
        cases.get(job.level, []).extend(bad)
    return report(rows, task.sensors.models, _pictures(rows, cases), first)


def _pictures(rows: Sequence[Row], cases: Mapping[str, Sequence[Case]]) -> tuple[Picture, ...]:
    if not cases:
        return ()
    searches = {level: sum(row["sensor"] == level for row in rows) for level in cases}
    return (Picture("The worst cases", ".jpg", sheet(cases, searches)),)


def measure_job(bench: BenchContext, job: ScenesJob) -> tuple[list[Row], list[Case]]:
    """The job's rows, and its worst cases."""
    import cv2

    cv2.setNumThreads(1)  # times are of one core
    cell, perceive = _cell(bench, job.level), skill_way(bench.skill(SKILL))
    first_of_process = not _warm
    rows, cases = worst(measure(cell, perceive, range(job.first, job.first + job.scenes)))
    if first_of_process:
        # The first scene of a process pays for loading libraries, which is no frame's time.
        _warm.append(True)
        rows = [row | {"ms": None} if row["seed"] == job.first else row for row in rows]
    return rows, cases


_warm: list[bool] = []
_cells: dict[str, StandaloneContext] = {}  # of this process, by noise level; processes end without closing them
_made: dict[str, Any] = {}  # what providers derive from the models, the same at every level


def _cell(bench: BenchContext, level: str) -> StandaloneContext:
    if level not in _cells:
        _cells[level] = standalone(bench, level_task(bench.task(TASK), level), SCENE)
        _cells[level].made = _made
    return _cells[level]


@cache
def skill_way(folder: Path) -> Perceive:
    """How the skill in `folder` perceives: its canonical script, then the noise filter and the box."""
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
