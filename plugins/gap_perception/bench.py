"""Measures perception on random scenes: each object is looked for the way a skill does, and judged by the truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gap_cli.contracts.failures import ToolError
from gap_cli.contracts.privilege import node_scope
from gap_cli.contracts.robot import RobotSpec
from gap_cli.contracts.task import Task
from gap_cli.contracts.tool import Tool
from gap_cli.contracts.types import CameraObservation, Mask, OrientedBoundingBox
from gap_cli.contracts.world import World
from gap_perception.bench_noise import SENSORS, Sensor, degrade
from gap_perception.bench_scenes import LEVELS, SCENE, Clutter, bench_task, sample_scene
from gap_perception.bench_truth import judge
from gap_perception.frames import remember
from gap_perception.scene.analyse import library_of

Perceive = Callable[["Cell", list[CameraObservation], str], tuple[OrientedBoundingBox, Mask]]


@dataclass
class Cell:
    """A tool context over one world, and the skill script's context too: `tool` calls a registered tool."""

    world: World
    task: Task
    robots: Mapping[str, RobotSpec]
    tools: Mapping[str, Tool]
    seed: int = 0
    state: dict[str, Any] = field(default_factory=dict)
    made: dict[str, Any] = field(default_factory=dict)

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""
        return self.robots[self.task.robots[arm_id].model]

    def shared(self, key: str, make: Callable[[], Any]) -> Any:
        """Made once."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def raise_if_cancelled(self) -> None:
        """Nobody cancels a measurement."""

    def tool(self, name: str, /, **inputs: Any) -> Any:
        """Call a tool by its catalogue name."""
        return self.tools[name](self, **inputs)


def measure(
    task: Task,
    robots: Mapping[str, RobotSpec],
    tools: Mapping[str, Tool],
    perceive: Perceive,
    seeds: Iterable[int],
    make_world: Callable[[Task, str, Mapping[str, RobotSpec]], World],
    levels: tuple[Clutter, ...] = LEVELS,
    sensor: Sensor = SENSORS[0],
) -> Iterator[dict[str, Any]]:
    """One row per scene and object of the task, in it or not; levels of clutter take turns. Seeds name scenes.

    `perceive` is a skill's way from frames to a box and a mask; it runs as a policy node and raises `ToolError` when it
    finds nothing. `sensor` degrades what it sees.
    """
    everything = bench_task(task)
    world = make_world(everything, SCENE, robots)
    cell = Cell(world, everything, robots, tools)
    library_of(cell)  # once per process, so no frame's time
    try:
        for count, seed in enumerate(seeds):
            clutter = levels[seed % len(levels)]
            instance, present = sample_scene(everything, clutter, seed)
            world.reset(instance)
            rows = _scene_rows(cell, perceive, clutter, seed, present, sensor)
            # The first scene of a process pays for loading libraries, which is no frame's time.
            yield from rows if count else ({**row, "ms": None} for row in rows)
    finally:
        world.close()


def _scene_rows(
    cell: Cell, perceive: Perceive, clutter: Clutter, seed: int, present: tuple[str, ...], sensor: Sensor
) -> Iterator[dict[str, Any]]:
    truth, clean = cell.world.snapshot(), cell.world.observe()
    seen = degrade(clean, sensor, seed)
    names = list(cell.task.objects)
    turn = seed % len(names)
    cell.state.clear()
    remember(cell.state, seen)
    # The first search of a scene pays for looking at the frames and is the one that is timed; they take turns.
    for name in names[turn:] + names[:turn]:
        with node_scope("bench/perceive"):
            started = time.process_time()
            try:
                found = perceive(cell, list(seen.cameras), cell.task.objects[name].label)
            except ToolError:
                found = None
            spent = time.process_time() - started
        row: dict[str, Any] = {"seed": seed, "clutter": clutter.name, "sensor": sensor.name, "object": name}
        row |= {"present": name in present, "ms": 1e3 * spent if name == names[turn] else None}
        yield row | judge(cell, truth, name, found, present, clean.cameras)


def summarise(rows: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Precision, recall, wrong-object rate, mask IoU, centre and yaw errors, and time, over all rows."""
    rows = list(rows)
    if not rows:
        return {}
    there = [r for r in rows if r["present"] and r["pixels"] >= MIN_VISIBLE]
    found = [r for r in rows if r["found"]]
    right = [r for r in found if not r["wrong"]]
    yaw = [r["yaw_deg"] for r in right if r["yaw_deg"] is not None]
    ms = [r["ms"] for r in rows if r["ms"] is not None]
    centre = [r["center_mm"] for r in right] or [float("nan")]
    return {
        "searches": len(rows),
        "precision": len(right) / max(len(found), 1),
        "recall": len([r for r in there if r["found"] and not r["wrong"]]) / max(len(there), 1),
        "wrong_rate": len([r for r in rows if r["wrong"]]) / max(len(rows), 1),
        "iou_median": float(np.median([r["iou"] for r in right] or [np.nan])),
        "center_mm_median": float(np.median(centre)),
        "center_mm_p95": float(np.quantile(centre, 0.95)),
        "yaw_deg_median": float(np.median(yaw or [np.nan])),
        "yaw_deg_p95": float(np.quantile(yaw or [np.nan], 0.95)),
        "ms_median": float(np.median(ms or [np.nan])),
        "ms_p95": float(np.quantile(ms or [np.nan], 0.95)),
    }


MIN_VISIBLE = 100  # pixels over all cameras from which an object counts as visible


def by(rows: Iterable[Mapping[str, Any]], key: str) -> dict[str, dict[str, float]]:
    """`summarise` per value of `key` (`object`, `clutter`, `sensor`), in order of appearance."""
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(str(row[key]), []).append(row)
    return {value: summarise(group) for value, group in groups.items()}
