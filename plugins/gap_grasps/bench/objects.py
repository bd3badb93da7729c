"""What the grasp benchmark grasps: a task's objects, and a frying pan, a mug and a box beside them, each alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.task import ObjectModel, Task
from gap_runtime.contracts.types import Array, Quaternion, Se3Pose, Vec3

# Frying pan: size and mass of LIBERO's chefmate_8_frypan. Mug and box: everyday sizes.
EXTRAS = {
    "frypan": {
        "label": "frying pan",
        "category": "cookware",
        "shape": {
            "kind": "pan",
            "size": (0.356, 0.204, 0.058),
            "wall": 0.005,
            "floor": 0.006,
            "handle": (0.025, 0.012),
        },
        "mass": 0.203,
        "looks": {"base": "#3b3d42", "accent": "#1b1b1d"},
    },
    "mug": {
        "label": "mug",
        "category": "cookware",
        "shape": {
            "kind": "mug",
            "size": (0.120, 0.085, 0.095),
            "wall": 0.004,
            "floor": 0.006,
            "handle": (0.014, 0.008),
        },
        "mass": 0.30,
        "looks": {"base": "#d8dde3", "accent": "#c0392b"},
    },
    "box": {
        "label": "box",
        "shape": {"kind": "box", "size": (0.070, 0.110, 0.050)},
        "mass": 0.10,
        "looks": {"base": "#a9784a"},
    },
}
REGION = ((-0.22, -0.22), (0.10, 0.22))  # m: where objects are put, corner to corner; both cameras and the arm reach it
HANDLE = "frypan_handle"  # the frying pan again, of which only the handle may be taken
LYING = {  # degrees about x, y, z: what a shape rests on besides its base
    "box": ((90, 0, 0), (0, 90, 0), (-90, 0, 0), (0, -90, 0)),
    "cylinder": ((90, 0, 0),),
}
STANDS, LIES = "standing", "lying"
GROUND = "floor"


@dataclass(frozen=True)
class Subject:
    """What one row is about: its name in the table, the object it is, and whether only its handle counts."""

    name: str
    model: str
    handle_only: bool = False


def bench_task(task: Task) -> Task:
    """The task's cell with the extra objects, and a scene for each object alone."""
    extras = {name: ObjectModel.load(data, name) for name, data in EXTRAS.items()}
    objects = {**{n: m for n, m in task.objects.items() if not m.is_container}, **extras}
    region = next(iter(task.belief.regions))
    return task.model_copy(update={"objects": objects, "scenes": {name: {name: region} for name in objects}})


def subjects(task: Task) -> tuple[Subject, ...]:
    """All rows of the table for a `bench_task`."""
    return (*(Subject(name, name) for name in task.objects), Subject(HANDLE, "frypan", handle_only=True))


def rest(task: Task, name: str, seed: int) -> str:
    """How the object rests: with even seeds it stands; with odd ones it lies, if it can."""
    return LIES if seed % 2 and task.objects[name].shape.kind in LYING else STANDS


def place(task: Task, name: str, seed: int) -> Instance:
    """The object alone, anywhere in the region, at any yaw, standing or lying on any of its sides as `rest` says."""
    rng = np.random.default_rng([seed, *name.encode()])
    shape, floor = task.objects[name].shape, task.environment.supports[GROUND].z
    low, high = np.array(REGION)
    xy, yaw = rng.uniform(low, high), rng.uniform(-180, 180)
    side = Rotation.identity()
    if rest(task, name, seed) == LIES:
        sides = LYING[shape.kind]
        side = Rotation.from_euler("xyz", sides[rng.integers(len(sides))], degrees=True)
    R = Rotation.from_euler("z", yaw, degrees=True) * side
    pose = Se3Pose(Vec3(float(xy[0]), float(xy[1]), floor + height(shape.size, R) / 2), Quaternion.of(R))
    return Instance(seed, name, {name: pose})


def height(size: tuple[float, float, float], R: Rotation) -> float:
    """How high a box of this size is when turned so [m]."""
    up: Array = np.abs(R.as_matrix()[2])
    return float(up @ np.array(size))
