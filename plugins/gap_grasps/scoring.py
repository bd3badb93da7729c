"""How good is a grasp? Friction-cone margin, purchase of the pads, leverage, room between the open jaws."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.robot import GripperSpec
from gap_cli.contracts.types import Array
from gap_grasps.clearance import BATCH, local_to
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
    scores = [0.0] * len(T_tcp)
    reach = np.array([gripper.finger_size[1], gripper.max_width / 2, gripper.finger_size[2]], dtype=np.float32)
    for start in range(0, len(T_tcp), BATCH):
        batch = T_tcp[start : start + BATCH]
        local = local_to(surface.points, batch)
        between = np.asarray((np.abs(local) <= reach).all(axis=2))
        for i, T in enumerate(batch):
            touched, normals = local[i][between[i]], surface.normals[between[i]]
            scores[start + i] = _score(touched, normals @ T[:3, 1], gripper, middle - T[:3, 3], T[:3, 1])
    return np.array(scores)


def _score(touched: Array, facing: Array, gripper: GripperSpec, offset: Array, closing: Array) -> float:
    """Of one pose: points between the pads in its frame (N, 3), how much each faces along the closing direction (N,),
    and where the object's middle is from the TCP (3,)."""
    if len(touched) < 2:
        return 0.0
    _, half_x, half_z = gripper.finger_size
    y = touched[:, 1]
    width = float(np.ptp(y))
    left, right = (y <= y.min() + SKIN) & (facing < 0), (y >= y.max() - SKIN) & (facing > 0)
    if width < THINNEST or not left.any() or not right.any():
        return 0.0
    cosine = min(float(np.median(-facing[left])), float(np.median(facing[right])))
    margin = float(cone_margin(np.array([cosine]))[0])
    purchase = min(_coverage(touched[side], half_x, half_z) for side in (left, right))
    lever = float(np.linalg.norm(offset - (offset @ closing) * closing))
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
