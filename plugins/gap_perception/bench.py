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
from gap_cli.contracts.snapshot import BodyState, WorldSnapshot
from gap_cli.contracts.task import Task
from gap_cli.contracts.tool import Tool
from gap_cli.contracts.types import Array, CameraObservation, Mask, OrientedBoundingBox
from gap_cli.contracts.world import World
from gap_perception.bench_scenes import LEVELS, SCENE, Clutter, bench_task, sample_scene

ROUND = 0.1  # relative difference of horizontal sides below which yaw means nothing
FOUND = 0.03  # m: a box centred farther off than this is not of that object
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
) -> Iterator[dict[str, Any]]:
    """One row per scene and object of the task, in it or not; levels take turns. Seeds name scenes."""
    everything = bench_task(task)
    world = make_world(everything, SCENE, robots)
    cell = Cell(world, everything, robots, tools)
    try:
        for seed in seeds:
            clutter = levels[seed % len(levels)]
            instance, present = sample_scene(everything, clutter, seed)
            world.reset(instance)
            yield from _scene_rows(cell, perceive, clutter, seed, present)
    finally:
        world.close()


def _scene_rows(
    cell: Cell, perceive: Perceive, clutter: Clutter, seed: int, present: tuple[str, ...]
) -> Iterator[dict[str, Any]]:
    truth = cell.world.snapshot()
    names = list(cell.task.objects)
    turn = seed % len(names)
    cell.state.clear()
    # The first search of a scene pays for looking at the frames and is the one that is timed; they take turns.
    for name in names[turn:] + names[:turn]:
        model = cell.task.objects[name]
        with node_scope("bench/perceive"):
            observed = cell.tool("observation.GetObservation")
            started = time.process_time()
            try:
                found: tuple[OrientedBoundingBox, Mask] | None = perceive(cell, observed.cameras, model.label)
            except ToolError:
                found = None
            spent = time.process_time() - started
        row: dict[str, Any] = {"seed": seed, "clutter": clutter.name, "object": name, "present": name in present}
        row["ms"] = 1e3 * spent if name == names[turn] else None
        yield row | _judge(cell, truth, name, found, present, observed.cameras)


def _judge(
    cell: Cell,
    truth: WorldSnapshot,
    name: str,
    found: tuple[OrientedBoundingBox, Mask] | None,
    present: tuple[str, ...],
    cameras: list[CameraObservation],
) -> dict[str, Any]:
    visible = [true_mask(cell, truth, name, camera, present) for camera in cameras] if name in present else []
    row: dict[str, Any] = {"found": found is not None, "pixels": int(sum(v.sum() for v in visible)), "wrong": False}
    if found is None:
        return row
    box, mask = found
    nearest = min(present, key=lambda n: _apart(truth.bodies[n], box))
    if name not in present or nearest != name or _apart(truth.bodies[name], box) > FOUND:
        return row | {"wrong": True}
    body = truth.bodies[name]
    overlap = max(_iou(mask.data, v) for v in visible if v.shape == mask.data.shape)
    error = box.center.array - body.box.center.array
    return row | {"iou": overlap, "center_mm": 1e3 * float(np.linalg.norm(error)), "yaw_deg": yaw_error(body.box, box)}


def true_mask(
    cell: Cell, truth: WorldSnapshot, name: str, camera: CameraObservation, present: tuple[str, ...]
) -> Array:
    """Pixels (H, W) whose measured point lies on the object's model where it truly is, and nearer than to any other."""
    from gap_perception.scene.analyse import library_of
    from gap_perception.scene.fit import Fit
    from gap_perception.scene.points import lift

    library, points = library_of(cell), lift(camera, cell.task.environment)
    distance = {}
    for other in present:
        pose = truth.bodies[other].pose
        fit = Fit(library[other], 0, pose.rotation.rotation.as_matrix(), pose.position.array, np.zeros(0))
        distance[other] = fit.surface_distance(points.xyz)
    nearest = np.min(list(distance.values()), axis=0)
    on = (distance[name] < 0.004) & (distance[name] <= nearest)
    mask = np.zeros(camera.depth.data.shape, dtype=bool)
    mask[points.rows[on], points.columns[on]] = True
    return mask


def yaw_error(true: OrientedBoundingBox, box: OrientedBoundingBox) -> float | None:
    """Angle between the longer horizontal sides, 0 to 90 [deg]; None for a box (almost) square seen from above."""
    half = true.extent.array[:2]
    if abs(half[0] - half[1]) <= ROUND * half.max():
        return None
    true_axis, axis = (_long_axis(b) for b in (true, box))
    return float(np.degrees(np.arccos(np.clip(abs(true_axis @ axis), 0, 1))))


def _long_axis(box: OrientedBoundingBox) -> Array:
    axes = box.orientation.rotation.as_matrix()
    axis = axes[:2, 0] if box.extent.x >= box.extent.y else axes[:2, 1]
    return np.asarray(axis / np.linalg.norm(axis))


def _apart(body: BodyState, box: OrientedBoundingBox) -> float:
    return float(np.linalg.norm((body.box.center.array - box.center.array)[:2]))


def _iou(a: Array, b: Array) -> float:
    union = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / union if union else 0.0


def summarise(rows: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Precision, recall, wrong-object rate, mask IoU, centre and yaw errors, and time, over all rows."""
    rows = list(rows)
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
        "ms_median": float(np.median(ms)),
        "ms_p95": float(np.quantile(ms, 0.95)),
    }


MIN_VISIBLE = 100  # pixels over all cameras from which an object counts as visible
