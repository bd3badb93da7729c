"""Does the open hand fit? Fingers and palm as boxes in the TCP frame against points and the support."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.robot import GripperSpec
from gap_cli.contracts.types import Array

OPENING_SLACK = 0.008  # m the jaws open beyond the object, shared by both sides
SUPPORT_GAP = 0.003  # m the fingertips stay above the support
PALM_HALF = (0.03, 0.10, 0.03)  # m: half sizes of the palm box along x, y (closing) and z of the TCP frame


def clear_of(points: Array, T_tcp: Array, opening: Array, gripper: GripperSpec, *, tolerance: int = 2) -> Array:
    """True for each pose (K,) whose fingers and palm contain at most `tolerance` of the points (N, 3).

    `opening` (K,) is the jaw width on approach [m]. Noise puts stray points anywhere; two are no obstacle.
    """
    half_y, half_x, half_z = gripper.finger_size
    reach = gripper.finger_depth + half_z
    out = np.zeros(len(T_tcp), dtype=bool)
    for i, T in enumerate(T_tcp):
        local = (points - T[:3, 3]) @ T[:3, :3]
        x, y, z = np.abs(local[:, 0]), np.abs(local[:, 1]), local[:, 2]
        inner = opening[i] / 2
        finger = (x <= half_x) & (y >= inner) & (y <= inner + 2 * half_y) & (z <= half_z) & (z >= -reach)
        palm = (x <= PALM_HALF[0]) & (y <= PALM_HALF[1]) & (z <= -reach) & (z >= -reach - 2 * PALM_HALF[2])
        out[i] = int(np.count_nonzero(finger | palm)) <= tolerance
    return out


def above(floor: float, T_tcp: Array, opening: Array, gripper: GripperSpec) -> Array:
    """True for each pose (K,) whose fingertips and palm corners stay `SUPPORT_GAP` above a level support [m]."""
    half_y, half_x, half_z = gripper.finger_size
    reach = gripper.finger_depth + half_z
    lowest = np.full(len(T_tcp), np.inf)
    for sx in (-1, 1):
        for sy in (-1, 1):
            tip = np.stack(
                [np.full(len(T_tcp), sx * half_x), sy * (opening / 2 + 2 * half_y), np.full(len(T_tcp), half_z)], axis=1
            )
            palm = np.array([sx * PALM_HALF[0], sy * PALM_HALF[1], -reach])
            for corner in (tip, np.tile(palm, (len(T_tcp), 1))):
                lowest = np.minimum(lowest, T_tcp[:, 2, 3] + np.einsum("ni,ni->n", T_tcp[:, 2, :3], corner))
    return lowest >= floor + SUPPORT_GAP


def jaw_opening(width: Array, gripper: GripperSpec) -> Array:
    """How wide the jaws open for contacts `width` apart [m]: some slack, never more than they can."""
    return np.minimum(width + OPENING_SLACK, gripper.max_width)
