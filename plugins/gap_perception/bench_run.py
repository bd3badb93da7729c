"""`gap bench perception`: the skill's own way from frames to a box, on held-out random scenes, as one table."""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from gap_cli.contracts.bench import BenchReport, Progress
from gap_cli.contracts.task import Task, load_task
from gap_cli.contracts.tool import Tool
from gap_cli.contracts.types import CameraObservation, Mask, OrientedBoundingBox
from gap_perception.bench import Cell, Perceive, by, measure
from gap_perception.bench_noise import SENSORS, Sensor

HELD_OUT = 10_000  # seeds from here on are never used to improve anything
SCENES = {"clean": 500}
FEWER_SCENES = 150  # with any other sensor
CHUNK = 25  # scenes per job
WORKERS = 2
TASK = "fulfill-grocery"  # whose cell and groceries are used
SKILL = "perception-single"
COLUMNS = (
    "sensor", "scenes", "searches", "precision", "recall", "wrong object", "mask IoU", "centre median [mm]",
    "centre p95 [mm]", "yaw median [deg]", "yaw p95 [deg]", "median [ms]", "p95 [ms]",
)  # fmt: skip
Row = dict[str, Any]


def run(progress: Progress) -> BenchReport:
    """Every sensor over its scenes, in worker processes."""
    jobs = [
        (sensor, HELD_OUT + start, min(CHUNK, scenes - start))
        for sensor in SENSORS
        for scenes in (SCENES.get(sensor.name, FEWER_SCENES),)
        for start in range(0, scenes, CHUNK)
    ]
    rows: list[Row] = []
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        for done, (job, found) in enumerate(zip(jobs, pool.map(scene_rows, jobs), strict=True)):
            progress((done + 1) / len(jobs), f"{job[0].name} sensor")
            rows += found
    return report(rows)


def report(rows: list[Row]) -> BenchReport:
    """One table: each sensor, then the clean sensor by clutter and by object."""
    table = [_line(name, summary, rows, "sensor", name) for name, summary in by(rows, "sensor").items()]
    clean = [r for r in rows if r["sensor"] == SENSORS[0].name]
    for key in ("clutter", "object"):
        for value, summary in by(clean, key).items():
            table.append(_line(f"{SENSORS[0].name}, {value.replace('_', ' ')}", summary, clean, key, value))
    notes = [
        "Every object of the task is searched for in every scene, in it or not. Wrong: a box of another or of none.",
        "Recall counts objects with 100 pixels or more in view; errors are of right boxes, by the simulator's truth.",
        "Sparse: 4 objects, 30 mm apart or more; usual: 7, 10 mm; dense: 10, 2 mm; standing, any yaw; and a basket.",
        f"Seeds from {HELD_OUT} on, used for nothing else. Time: processor time of the first search in a scene, two",
        "cameras to box, rendering left out; later searches in the same frames take a tenth of it.",
        *(_sensor_note(s) for s in SENSORS[1:]),
    ]
    return BenchReport("Perception on random cluttered scenes", COLUMNS, tuple(table), tuple(notes), PACKAGES)


PACKAGES = ("mujoco", "numpy", "scipy", "opencv-python-headless", "scikit-learn")


def _line(title: str, summary: Mapping[str, float], rows: list[Row], key: str, value: str) -> tuple[Any, ...]:
    mine = [r for r in rows if r[key] == value]
    numbers = [_rounded(name, number) for name, number in summary.items() if name != "searches"]
    return (title, len({r["seed"] for r in mine}), len(mine), *numbers)


def _rounded(name: str, number: float) -> float | str:
    if not math.isfinite(number):
        return ""
    return round(number, 1 if name.endswith(("median", "p95")) and name != "iou_median" else 4)


def _sensor_note(sensor: Sensor) -> str:
    return (
        f"Sensor {sensor.name}: depth noise {1e3 * sensor.depth:g} mm at 1 m growing with its square, "
        f"{100 * sensor.dropout:g} % dropout, half of the {sensor.edge} px around depth edges lost, colour noise "
        f"{sensor.colour:g} levels, light ±{100 * sensor.light:g} %, calibration off by {1e3 * sensor.shift:g} mm and "
        f"{sensor.turn:g}° per camera."
    )


def scene_rows(job: tuple[Sensor, int, int]) -> list[Row]:
    """The rows of one job: a sensor, the first seed, and how many scenes."""
    return list(_rows(*job))


def _rows(sensor: Sensor, first: int, count: int) -> Iterator[Row]:
    from gap_mujoco.world import MujocoWorld
    from gap_robots.panda import panda

    seeds = range(first, first + count)
    yield from measure(_task(), {"panda": panda()}, _tools(), skill_way(), seeds, MujocoWorld, sensor=sensor)


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

    def perceive(cell: Cell, cameras: list[CameraObservation], label: str) -> tuple[OrientedBoundingBox, Mask]:
        found = script.run(cell, cameras, label, prompt)
        return cell.tool("geometry_svc.FilterAndComputeOBB", point_cloud=found.cloud), found.mask

    return perceive


def _tools() -> dict[str, Tool]:
    from gap_geometry import boxes, clouds
    from gap_perception import detect, language, observation, segment

    modules = (boxes, clouds, detect, language, observation, segment)
    return {tool.spec.name: tool for module in modules for tool in module.TOOLS}


def _task() -> Task:
    from gap_tasks import tasks_folder

    return load_task(tasks_folder() / TASK)
