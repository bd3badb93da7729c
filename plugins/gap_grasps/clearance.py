"""Does the open hand fit? Fingers as boxes and the palm as its collision spheres, against points and the support."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from gap_cli.contracts.robot import GripperSpec, RobotSpec
from gap_cli.contracts.types import Array

SUPPORT_GAP = 0.003  # m the hand stays above the support
FINGER_GAP = 0.0015  # m the fingers stay away from points, and
PALM_GAP = 0.002  # m the palm does: half a pixel's error
SHADOW = 0.06  # m of straight approach on which the fingers must be free
STRAY = 2  # points in the hand's way that are no obstacle: noise puts some anywhere
BATCH = 64  # poses looked at together


class Hand(NamedTuple):
    """The open hand in the TCP frame: the gripper; palm and wrist as spheres, `centers` (S, 3) and `radii` (S,) [m]."""

    gripper: GripperSpec
    centers: Array
    radii: Array

    @classmethod
    def of(cls, spec: RobotSpec) -> Hand:
        """The hand of a robot: the collision spheres of its flange link, and of what is fixed to that."""
        from gap_motion.kinematics import chain as chain_of

        chain = chain_of(spec)
        fixed = {n: k for n, k in chain.links.items() if k.frame == chain.dof - 1 and not k.slide.any()}
        T_tcp_frame = np.linalg.inv(chain.tcp)
        spheres = [s for s in spec.spheres if s.link in fixed]
        placed = [T_tcp_frame @ fixed[s.link].transform @ np.append(s.center, 1.0) for s in spheres]
        return cls(spec.gripper, np.array(placed).reshape(-1, 4)[:, :3], np.array([s.radius for s in spheres]))


def clear_of(points: Array, T_tcp: Array, hand: Hand) -> Array:
    """True for each pose (K,) whose open fingers, on their way in, and palm meet at most `STRAY` points (N, 3)."""
    if not len(points) or not len(T_tcp):
        return np.ones(len(T_tcp), dtype=bool)
    free = _palm_is_free(points, T_tcp, hand)
    half_y, half_x, half_z = hand.gripper.finger_size
    inner = hand.gripper.max_width / 2
    outer, back = inner + 2 * half_y, hand.gripper.finger_depth + half_z + SHADOW
    for start in range(0, len(T_tcp), BATCH):
        local = local_to(points, T_tcp[start : start + BATCH])
        y, z = np.abs(local[..., 1]), local[..., 2]
        inside = (y >= inner - FINGER_GAP) & (y <= outer + FINGER_GAP) & (z <= half_z + FINGER_GAP) & (z >= -back)
        inside &= np.abs(local[..., 0]) <= half_x + FINGER_GAP
        free[start : start + BATCH] &= np.count_nonzero(inside, axis=1) <= STRAY
    return free


def local_to(points: Array, T_tcp: Array) -> Array:
    """The points (N, 3) in the frame of each pose (K, 4, 4): (K, N, 3), single precision."""
    T = T_tcp.astype(np.float32)
    return np.asarray(
        points.astype(np.float32) @ T[:, :3, :3] - np.einsum("ki,kij->kj", T[:, :3, 3], T[:, :3, :3])[:, None]
    )


def _palm_is_free(points: Array, T_tcp: Array, hand: Hand) -> Array:
    if not len(hand.radii):
        return np.ones(len(T_tcp), dtype=bool)
    centers = hand.centers @ T_tcp[:, :3, :3].transpose(0, 2, 1) + T_tcp[:, None, :3, 3]
    k = min(STRAY + 1, len(points))
    distance, _ = cKDTree(points).query(
        centers.reshape(-1, 3), k=[k], distance_upper_bound=float(hand.radii.max()) + 2 * PALM_GAP
    )
    return np.asarray((distance.reshape(len(T_tcp), -1) >= hand.radii + PALM_GAP).all(axis=1))


def above(floor: float, T_tcp: Array, hand: Hand) -> Array:
    """True for each pose (K,) whose open fingertips and palm stay `SUPPORT_GAP` above a level support [m]."""
    half_y, half_x, half_z = hand.gripper.finger_size
    outer = hand.gripper.max_width / 2 + 2 * half_y
    down = -T_tcp[:, 2, :3]  # how much each axis of the TCP points down
    lowest = T_tcp[:, 2, 3] - np.abs(down[:, 0]) * half_x - np.abs(down[:, 1]) * outer - down[:, 2] * half_z
    if len(hand.radii):
        spheres = T_tcp[:, 2, 3, None] - down @ hand.centers.T - hand.radii
        lowest = np.minimum(lowest, spheres.min(axis=1))
    return np.asarray(lowest >= floor + SUPPORT_GAP)
