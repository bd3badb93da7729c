"""How good is a grasp? Friction-cone margin, leverage about the object's middle, and purchase of the pads."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.robot import GripperSpec
from gap_cli.contracts.types import Array
from gap_grasps.sampling import cone_margin
from gap_grasps.surface import Surface

FULL_PURCHASE = 25  # surface points between the pads from which contact counts as full


def score_poses(surface: Surface, T_tcp: Array, gripper: GripperSpec) -> Array:
    """Score in [0, 1] of each pose (K,): the product of three measures, each 1 when nothing speaks against it.

    margin    of the worse contact inside its friction cone (Nguyen 1988; two-finger force closure).
    leverage  1 - |distance of the closing line from the object's middle| / half its longest side: gravity twists
              a part held off its middle out of the pads.
    purchase  how much of the pads meets the object.
    A pose with nothing between its jaws, or contacts wider than they open, scores 0.
    """
    middle = surface.centroid
    reach = max(float(np.ptp(surface.points, axis=0).max()) / 2, 1e-3)
    return np.array([_score(surface, T, gripper, middle, reach) for T in T_tcp])


def _score(surface: Surface, T: Array, gripper: GripperSpec, middle: Array, reach: float) -> float:
    _, half_x, half_z = gripper.finger_size
    local = (surface.points - T[:3, 3]) @ T[:3, :3]
    between = (
        (np.abs(local[:, 0]) <= half_x)
        & (np.abs(local[:, 2]) <= half_z)
        & (np.abs(local[:, 1]) <= gripper.max_width / 2)
    )
    if np.count_nonzero(between) < 2:
        return 0.0
    y = local[between, 1]
    normals = surface.normals[between] @ T[:3, 1]
    left, right = y <= y.min() + 0.003, y >= y.max() - 0.003
    if y.max() - y.min() > gripper.max_width or y.max() - y.min() < 0.002:
        return 0.0
    cosine = min(float(np.median(-normals[left])), float(np.median(normals[right])))
    margin = float(cone_margin(np.array([cosine]))[0])
    offset = middle - T[:3, 3]
    lever = float(np.linalg.norm(offset - (offset @ T[:3, 1]) * T[:3, 1]))
    purchase = min(1.0, min(np.count_nonzero(left), np.count_nonzero(right)) / FULL_PURCHASE)
    return margin * max(0.0, 1 - lever / reach) * (0.5 + 0.5 * purchase)
