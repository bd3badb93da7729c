"""How good is a grasp? Friction-cone margin, purchase of the pads, leverage, room between the open jaws."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.robot import GripperSpec
from gap_cli.contracts.types import Array
from gap_grasps.sampling import THINNEST, cone_margin
from gap_grasps.surface import Surface

PATCHES = (3, 3)  # parts of a pad, along its width and along the approach, that may or may not meet the object
LEVER = 0.15  # m from the object's middle at which gravity halves a grasp's worth
ROOM = 0.004  # m between object and each open jaw from which a few millimetres' error do not matter
SKIN = 0.003  # m: points this near to the outermost one touch the pad too


def score_poses(surface: Surface, T_tcp: Array, gripper: GripperSpec) -> Array:
    """Score in [0, 1] of each pose (K,): the product of four measures, each 1 when nothing speaks against it.

    margin    of the worse contact inside its friction cone (Nguyen 1988; two-finger force closure).
    purchase  how much of the worse pad meets the object.
    leverage  how near the object's middle is to the closing line: gravity twists a part held off it out of the pads.
    room      between the open jaws and the object: a tight fit does not survive errors of a few millimetres.
    A pose with nothing between its jaws, or contacts wider than they open, scores 0.
    """
    middle = surface.centroid
    return np.array([_score(surface, T, gripper, middle) for T in T_tcp])


def _score(surface: Surface, T: Array, gripper: GripperSpec, middle: Array) -> float:
    _, half_x, half_z = gripper.finger_size
    local = (surface.points - T[:3, 3]) @ T[:3, :3]
    between = (np.abs(local) <= (half_x, gripper.max_width / 2, half_z)).all(axis=1)
    if np.count_nonzero(between) < 2:
        return 0.0
    touched = local[between]
    y, facing = touched[:, 1], surface.normals[between] @ T[:3, 1]
    width = float(np.ptp(y))
    left, right = (y <= y.min() + SKIN) & (facing < 0), (y >= y.max() - SKIN) & (facing > 0)
    if width < THINNEST or not left.any() or not right.any():
        return 0.0
    cosine = min(float(np.median(-facing[left])), float(np.median(facing[right])))
    margin = float(cone_margin(np.array([cosine]))[0])
    purchase = min(_coverage(touched[side], half_x, half_z) for side in (left, right))
    offset = middle - T[:3, 3]
    lever = float(np.linalg.norm(offset - (offset @ T[:3, 1]) * T[:3, 1]))
    # The jaws centre what they close on: only the sum of both sides' room counts.
    room = min(1.0, max(0.0, (gripper.max_width - width) / (2 * ROOM)))
    return margin * (0.3 + 0.7 * purchase) * room / (1 + (lever / LEVER) ** 2)


def _coverage(points: Array, half_x: float, half_z: float) -> float:
    """Share of a pad's patches that hold one of the points (N, 3), given in the TCP frame."""
    cells = [
        np.clip(((points[:, axis] / half + 1) / 2 * n).astype(int), 0, n - 1)
        for axis, half, n in ((0, half_x, PATCHES[0]), (2, half_z, PATCHES[1]))
    ]
    return len(np.unique(cells[0] * PATCHES[1] + cells[1])) / (PATCHES[0] * PATCHES[1])
