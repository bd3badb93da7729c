"""Random cluttered scenes of a task's objects, to measure perception on: all objects in one world, some out of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.task import Placement, Task
from gap_runtime.contracts.types import Array, Quaternion, Se3Pose, Vec3

SCENE = "bench"
AREA = ((-0.25, 0.20), (-0.30, 0.15))  # m, x and y: where the arm reaches and both cameras look
BIN = ((-0.03, 0.03), (0.24, 0.28))  # m: where containers stand
AWAY = (-1.2, 1.6)  # m: beyond the workspace, where unused objects wait out of sight
APART_AWAY = 0.25  # m
TRIES = 500


@dataclass(frozen=True)
class Clutter:
    """How many objects share the area, and the least gap between their outlines [m]."""

    name: str
    objects: int
    gap: float


LEVELS = (Clutter("sparse", 4, 0.03), Clutter("usual", 7, 0.01), Clutter("dense", 10, 0.002))


def bench_task(task: Task) -> Task:
    """The task with one scene that holds every object; the regions are only there to make it a valid task."""
    support = next(iter(task.environment.supports))
    region = Placement(center=(0.0, 0.0), support=support)
    belief = task.belief.model_copy(update={"regions": {**task.belief.regions, SCENE: region}})
    return task.model_copy(update={"belief": belief, "scenes": {SCENE: dict.fromkeys(task.objects, SCENE)}})


def sample_scene(task: Task, clutter: Clutter, seed: int) -> tuple[Instance, tuple[str, ...]]:
    """A random instance of the bench scene and the names of the objects in view."""
    rng = np.random.default_rng(seed)
    bins = [name for name, model in task.objects.items() if model.is_container]
    others = [name for name in task.objects if name not in bins]
    chosen = [str(n) for n in rng.permutation(others)[: clutter.objects]]
    placed: dict[str, Array] = {}
    for name in (*bins, *chosen):
        spot = _free_spot(task, name, placed, clutter.gap, rng, BIN if name in bins else AREA)
        if spot is not None:
            placed[name] = spot
    poses = {name: _standing(task, name, spot) for name, spot in placed.items()}
    for i, name in enumerate(n for n in task.objects if n not in placed):
        poses[name] = _standing(task, name, np.array([AWAY[0] + APART_AWAY * (i % 4), AWAY[1] + 0.15 * (i // 4), 0.0]))
    return Instance(seed, SCENE, poses), tuple(placed)


def _free_spot(
    task: Task, name: str, placed: Mapping[str, Array], gap: float, rng: np.random.Generator,
    area: Sequence[tuple[float, float]],
) -> Array | None:  # fmt: skip
    """x, y [m] and yaw [rad] whose footprint keeps the gap to all others, or None."""
    from gap_perception.outlines import outline_gap

    for _ in range(TRIES):
        spot = np.array([rng.uniform(*area[0]), rng.uniform(*area[1]), rng.uniform(-np.pi, np.pi)])
        outline = _outline(task, name, spot)
        if all(outline_gap(outline, _outline(task, n, s)) >= gap for n, s in placed.items()):
            return spot
    return None


def _outline(task: Task, name: str, spot: Array) -> Array:
    """Corners of the footprint, shape (4, 2) [m]."""
    half = np.array(task.objects[name].shape.size[:2]) / 2
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * half
    c, s = np.cos(spot[2]), np.sin(spot[2])
    return np.asarray(corners @ np.array([[c, s], [-s, c]]) + spot[:2])


def _standing(task: Task, name: str, spot: Array) -> Se3Pose:
    support = next(iter(task.environment.supports.values()))
    z = support.z + task.objects[name].shape.size[2] / 2
    return Se3Pose(Vec3(float(spot[0]), float(spot[1]), z), Quaternion.of(Rotation.from_euler("z", float(spot[2]))))
