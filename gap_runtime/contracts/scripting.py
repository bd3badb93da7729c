"""What scripts of several skills compute: pure helpers, loaded in the jail too, where scripts import contracts only.

They call no tools: which tools a script may use is read from its own text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import (
    Array,
    BoundingBox2D,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
    WorldConfig,
)

COMPARED = 400  # points per cloud; enough to tell clouds millimetres apart, few enough for all pairs
MOST_CELLS = 2.0**62  # that integers can number
GRID = 0.002  # m: finer than the depth, coarse enough for what reads a cloud to be quick


def cloud_gap(a: Array, b: Array) -> float:
    """Smallest distance [m] between two clouds (N, 3) and (M, 3), on an even sample of each."""
    a, b = (points[:: len(points) // COMPARED + 1] for points in (a, b))
    return float(np.linalg.norm(a[:, None] - b[None], axis=2).min())


def thinned(points: Array) -> Array:
    """The first of the finite points (N, 3) [m] in every occupied grid cell, in their order."""
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return points
    _, first = np.unique(cell_numbers(points, GRID), return_index=True)
    return np.asarray(points[np.sort(first)])


def cell_numbers(points: Array, spacing: float) -> Array:
    """A number for the grid cell of each of at least one point (N, 3), the same for points of one cell; shape (N,).

    They order the cells along x, then y, then z. Sorting one number is several times faster than sorting three.
    """
    cells = np.floor(points / spacing)
    cells -= cells.min(axis=0)
    sides = cells.max(axis=0) + 1
    if sides.prod() > MOST_CELLS:
        return np.asarray(np.unique(cells, axis=0, return_inverse=True)[1].ravel())
    return np.asarray(np.ravel_multi_index(tuple(cells.astype(np.int64).T), tuple(sides.astype(np.int64))))


def numbered_question(prompt: str, object_name: str, boxes: Sequence[BoundingBox2D]) -> str:
    """The prompt with `{object_name}` and, for `{boxes}`, a numbered line of pixels for each."""
    rows = [
        f"{number}: [{b.x_min:.0f}, {b.y_min:.0f}, {b.x_max:.0f}, {b.y_max:.0f}]" for number, b in enumerate(boxes, 1)
    ]
    return prompt.replace("{object_name}", object_name).replace("{boxes}", "\n".join(rows))


def named_index(answer: str, count: int) -> int | None:
    """Which of `count` numbered things an answer names, from 0; None for none and for what is not understood."""
    found = re.fullmatch(r"(?:box |number )?(\d+)\W*", answer.strip().lower())
    return int(found[1]) - 1 if found is not None and 1 <= int(found[1]) <= count else None


def points_around(cell: WorldConfig) -> Array:
    """Points (N, 3) [m] of everything seen but the target itself; supports have none."""
    clouds = [o.points for o in cell.obstacles if o.points is not None and o.name != "target"]
    return np.concatenate([np.zeros((0, 3)), *clouds])


def hover_height(spec: RobotSpec, start: Se3Pose, obb: OrientedBoundingBox, points: Array, pass_over: float) -> float:
    """TCP height [m] from which everything between the hand and the target is passed over, at most the hand's own.

    `start` is T_world_tcp now, `points` (N, 3) [m] what is around, `pass_over` the room below the fingertips [m].
    """
    aside = beside_way(points, start.position.array, obb.center.array)
    beside = points[aside < spec.gripper.max_width / 2 + 2 * max(spec.gripper.finger_size), 2]
    top = max([obb.center.z + obb.extent.z, *beside.tolist()])
    return float(min(top + spec.gripper.finger_size[2] + pass_over, start.position.z))


def in_reach(solve_ik: Callable[[Se3Pose], Any], T_world_tcp: Se3Pose) -> bool:
    """True when inverse kinematics, which the script calls itself, finds a solution."""
    try:
        return bool(solve_ik(T_world_tcp).success)
    except PlanningError:
        return False


def held_corners(obb: OrientedBoundingBox, T_world_tcp: Se3Pose) -> Array:
    """Corners of a held object in the TCP frame, shape (8, 3) [m], from its box and the hand's pose at the grasp."""
    return np.asarray(T_world_tcp.rotation.rotation.inv().apply(obb.corners - T_world_tcp.position.array))


def tcp_pose(xy: Array, z: float, rotation: Rotation) -> Se3Pose:
    """T_world_tcp from its parts [m]."""
    return Se3Pose(Vec3(float(xy[0]), float(xy[1]), z), Quaternion.of(rotation))


def tcp_down(xy: Array, z: float, yaw: float) -> Se3Pose:
    """T_world_tcp looking straight down, its x axis at `yaw` [rad] about the vertical; the jaws close across it."""
    return tcp_pose(xy, z, Rotation.from_euler("z", yaw) * Rotation.from_euler("x", np.pi))


def long_axis_yaw(obb: OrientedBoundingBox) -> float:
    """Angle about the vertical of an upright box's longer horizontal side [rad]."""
    axes = obb.orientation.rotation.as_matrix()
    long = axes[:, int(np.argmax(obb.extent.array[:2]))]
    return float(np.arctan2(long[1], long[0]))


def beside_way(points: Array, a: Array, b: Array) -> Array:
    """How far each of the points (N, 3) is, seen from above, from the straight way from a to b, shape (N,) [m]."""
    way = b[:2] - a[:2]
    t = np.clip((points[:, :2] - a[:2]) @ way / max(float(way @ way), 1e-9), 0, 1)
    return np.asarray(np.linalg.norm(points[:, :2] - (a[:2] + t[:, None] * way), axis=1))
