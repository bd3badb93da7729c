"""A robot's open hand, fingers as boxes and palm as spheres: which points are near it, and where it fits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from gap_catalogue.shared.robot_chain import chain as chain_of
from gap_runtime.contracts.robot import GripperSpec, RobotSpec
from gap_runtime.contracts.types import Array

SUPPORT_GAP = 0.003  # m the hand stays above the support
FINGER_GAP = 0.0015  # m the fingers stay away from points, and
PALM_GAP = 0.002  # m the palm does: half a pixel's error
SHADOW = 0.06  # m of straight approach on which the fingers must be free
COARSELY = 5  # every which point is looked at first
ELEMENTS = 2_000_000  # of a poses-by-points table looked at together: what fits the caches and the memory
STRAY = 2  # points in the hand's way that are no obstacle: noise puts some anywhere


class Hand(NamedTuple):
    """The open hand in the TCP frame: the gripper; palm and wrist as spheres, `centers` (S, 3) and `radii` (S,) [m]."""

    gripper: GripperSpec
    centers: Array
    radii: Array

    @classmethod
    def of(cls, spec: RobotSpec) -> Hand:
        """The hand of a robot: the collision spheres of its flange link, and of what is fixed to that."""
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
    free = np.ones(len(T_tcp), dtype=bool)
    # What meets too many of a few points need not be held against all of them.
    for part in (points[::COARSELY], points):
        free[free] = _fingers_meet(part, T_tcp[free], hand) <= STRAY
    free[free] = palm_room(points, T_tcp[free], hand, at_most=2 * PALM_GAP) >= PALM_GAP
    return free


def _fingers_meet(points: Array, T_tcp: Array, hand: Hand) -> Array:
    """How many points are in the way of each pose's open fingers, (K,)."""
    half_y, half_x, half_z = hand.gripper.finger_size
    inner = hand.gripper.max_width / 2
    back = hand.gripper.finger_depth + half_z + SHADOW
    high = np.array([half_x, inner + 2 * half_y, half_z]) + FINGER_GAP
    near = nearby(points, T_tcp, np.array([-high[0], -high[1], -back]), high)
    met = near.pose[np.abs(near.local[:, 1]) >= inner - FINGER_GAP]
    return np.bincount(met, minlength=len(T_tcp))


def palm_room(points: Array, T_tcp: Array, hand: Hand, at_most: float) -> Array:
    """Distance [m] between palm and points (N, 3) but for `STRAY` of them, for each pose (K,); no more than `at_most`,
    negative where they overlap."""
    if not len(hand.radii) or not len(points) or not len(T_tcp):
        return np.full(len(T_tcp), at_most)
    centers = hand.centers @ T_tcp[:, :3, :3].transpose(0, 2, 1) + T_tcp[:, None, :3, 3]
    k = min(STRAY + 1, len(points))
    distance, _ = cKDTree(points).query(
        centers.reshape(-1, 3), k=[k], distance_upper_bound=float(hand.radii.max()) + at_most
    )
    return np.asarray(np.minimum(distance.reshape(len(T_tcp), -1) - hand.radii, at_most).min(axis=1))


def above(floor: float, T_tcp: Array, hand: Hand, gap: float = SUPPORT_GAP) -> Array:
    """True for each pose (K,) whose open fingertips and palm stay `gap` [m] above a level support [m]."""
    half_y, half_x, half_z = hand.gripper.finger_size
    outer = hand.gripper.max_width / 2 + 2 * half_y
    down = -T_tcp[:, 2, :3]  # how much each axis of the TCP points down
    lowest = T_tcp[:, 2, 3] - np.abs(down[:, 0]) * half_x - np.abs(down[:, 1]) * outer - down[:, 2] * half_z
    if len(hand.radii):
        spheres = T_tcp[:, 2, 3, None] - down @ hand.centers.T - hand.radii
        lowest = np.minimum(lowest, spheres.min(axis=1))
    return np.asarray(lowest >= floor + gap)


class Nearby(NamedTuple):
    """Pairs of a pose and a point in the box around it, sorted by pose: indices (R,) and (R,), and the point in the
    pose's frame (R, 3), single precision."""

    pose: Array
    point: Array
    local: Array


def nearby(points: Array, T: Array, low: Array, high: Array) -> Nearby:
    """All points (N, 3) within the box from `low` to `high` (3,) of the frame of each pose T (K, 4, 4)."""
    points, T = points.astype(np.float32), T.astype(np.float32)
    poses, indices, locals_ = [], [], []
    batch = max(1, ELEMENTS // max(len(points), 1))
    for start in range(0, len(T), batch):
        R, p = T[start : start + batch, :3, :3], T[start : start + batch, :3, 3]
        origin = np.einsum("ki,kij->kj", p, R)
        axes = [R[:, :, axis] @ points.T - origin[:, axis, None] for axis in range(3)]
        inside = np.ones(axes[0].shape, dtype=bool)
        for axis, values in enumerate(axes):
            inside &= (values >= low[axis]) & (values <= high[axis])
        pose, point = np.nonzero(inside)
        poses.append(pose + start)
        indices.append(point)
        locals_.append(np.stack([values[pose, point] for values in axes], axis=1))
    if not poses:
        return Nearby(np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros((0, 3), dtype=np.float32))
    return Nearby(np.concatenate(poses), np.concatenate(indices), np.concatenate(locals_))
