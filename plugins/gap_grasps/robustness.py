"""What becomes of a grasp when the hand misses its place a little: shares of misplacements that do no harm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gap_catalogue.shared.hand import SHADOW, STRAY, Hand, Nearby, above, nearby, palm_room
from gap_grasps.pose_error import DECLARED, SPREAD, PoseError, spread
from gap_grasps.sampling import FRICTION, THINNEST
from gap_grasps.surface import Surface
from gap_runtime.contracts.types import Array

PATCHES = (3, 3)  # parts of a pad, along its width and along the approach, that may or may not meet the object
SKIN = 0.003  # m: points this near to the outermost one touch the pad too
REACH = 2.5  # standard deviations of the position within which points are looked for
FLOOR_SPREAD = 64  # misplacements looked at over the support: no points, so they cost little
CONE = float(np.cos(np.arctan(FRICTION)))  # of the angle to the normal at which a contact begins to slide
LEVER = 0.15  # m from the object's middle at which gravity halves a grasp's worth


class Measures(NamedTuple):
    """Of each of K grasps, in [0, 1], 1 the best; all but `leverage` are means over misplacements of the hand.

    support   nothing of the open hand meets the support.
    fingers   the open fingers meet neither object nor neighbours on their way in.
    palm      neither does the palm.
    closure   how much of the worse contact has the closing line inside its friction cone (Nguyen 1988).
    purchase  how much of the worse pad meets the object: what resists twisting and slipping.
    leverage  how near the object's middle is to the closing line: gravity twists a part held off it.
    """

    support: Array
    fingers: Array
    palm: Array
    closure: Array
    purchase: Array
    leverage: Array


def misplacement_robustness(
    surface: Surface, T: Array, hand: Hand, floor: float | None, obstacles: Array | None = None,
    error: PoseError = DECLARED,
) -> Measures:  # fmt: skip
    """Measures of the TCP poses T (K, 4, 4) on a surface that stands on a level support at `floor` [m], or on none.

    Robust grasp quality after Weisz and Allen (2012): the same analytic tests on many misplaced hands, counted.
    """
    solid = surface.points if obstacles is None else np.concatenate([surface.points, obstacles])
    near = _around_fingers(solid, T, hand, error)
    closure, purchase = _pads(near, surface, T, hand, error)
    return Measures(
        _over_support(T, hand, floor, error), _fingers(near, len(T), hand, error), _palm(solid, T, hand, error),
        closure, purchase, _leverage(surface, T),
    )  # fmt: skip


def _around_fingers(points: Array, T: Array, hand: Hand, error: PoseError) -> Nearby:
    half_y, half_x, half_z = hand.gripper.finger_size
    outer = hand.gripper.max_width / 2 + 2 * half_y
    back = hand.gripper.finger_depth + half_z + SHADOW
    high = np.array([half_x, outer, half_z]) + REACH * error.position
    return nearby(points, T, np.array([-high[0], -high[1], -back]), high)


def _fingers(near: Nearby, count: int, hand: Hand, error: PoseError) -> Array:
    half_y, half_x, half_z = hand.gripper.finger_size
    inner, outer = hand.gripper.max_width / 2, hand.gripper.max_width / 2 + 2 * half_y
    may_meet = np.abs(near.local[:, 1]) >= inner - REACH * error.position
    local, pose = near.local[may_meet], near.pose[may_meet]
    free = np.zeros(count)
    for offset, turn in _single(error):
        x, y, z = (_moved(local, offset, turn, axis) for axis in range(3))
        np.abs(y, out=y)
        met = (y >= inner) & (y <= outer) & (np.abs(x) <= half_x) & (z <= half_z)
        free += np.bincount(pose[met], minlength=count) <= STRAY
    return free / SPREAD


def _pads(near: Nearby, surface: Surface, T: Array, hand: Hand, error: PoseError) -> tuple[Array, Array]:
    """Closure and purchase, each (K,)."""
    grown = REACH * error.position
    may_touch = near.point < len(surface.points)
    may_touch &= np.abs(near.local[:, 1]) <= hand.gripper.max_width / 2 + grown
    may_touch &= near.local[:, 2] >= -hand.gripper.finger_size[2] - grown
    pose, local = near.pose[may_touch], near.local[may_touch]
    normals = np.einsum(
        "ri,rij->rj", surface.normals.astype(np.float32)[near.point[may_touch]], T[:, :3, :3].astype(np.float32)[pose]
    )
    closure, purchase = np.zeros(len(T)), np.zeros(len(T))
    for offset, turn in _single(error):
        x, y, z = (_moved(local, offset, turn, axis) for axis in range(3))
        inside, covered = _held((x, y, z), normals @ turn[:, 1], pose, len(T), hand)
        closure += inside
        purchase += covered
    return closure / SPREAD, purchase / SPREAD


def _single(error: PoseError) -> list[tuple[Array, Array]]:
    offsets, turns = spread(error)
    return list(zip(offsets.astype(np.float32), turns.astype(np.float32), strict=True))


def _moved(local: Array, offset: Array, turn: Array, axis: int) -> Array:
    """One coordinate of points (R, 3) in the frame of a misplaced hand, (R,)."""
    return np.asarray(local @ turn[:, axis] - offset @ turn[:, axis])


def _held(local: tuple[Array, Array, Array], facing: Array, pose: Array, count: int, hand: Hand) -> tuple[Array, Array]:
    """Of one misplacement: share of the worse contact's points whose normal allows it (K,), 0 where nothing is held,
    and the worse pad's purchase (K,); points by coordinate, each (R,)."""
    _, half_x, half_z = hand.gripper.finger_size
    x, y, z = local
    between = np.flatnonzero((np.abs(x) <= half_x) & (np.abs(y) <= hand.gripper.max_width / 2) & (np.abs(z) <= half_z))
    if not len(between):
        return np.zeros(count), np.zeros(count)
    y, facing, pose = y[between], facing[between], pose[between]
    patch = _patch(x[between], half_x, PATCHES[0]) * PATCHES[1] + _patch(z[between], half_z, PATCHES[1])
    first = np.flatnonzero(np.diff(pose, prepend=-1))
    low, high = np.full(count, np.inf, np.float32), np.full(count, -np.inf, np.float32)
    low[pose[first]], high[pose[first]] = np.minimum.reduceat(y, first), np.maximum.reduceat(y, first)
    share, covered = np.ones(count), np.ones(count)
    for touched in ((y <= low[pose] + SKIN) & (facing < 0), (y >= high[pose] - SKIN) & (facing > 0)):
        mine = pose[touched]
        points = np.bincount(mine, minlength=count)
        inside = np.bincount(pose[touched & (np.abs(facing) > CONE)], minlength=count)
        share = np.minimum(share, inside / np.maximum(points, 1))
        patches = np.zeros((count, PATCHES[0] * PATCHES[1]), dtype=bool)
        patches[mine, patch[touched]] = True
        covered = np.minimum(covered, patches.mean(axis=1))
    held = high - low >= THINNEST
    return np.where(held, share, 0.0), np.where(held, covered, 0.0)


def _patch(along: Array, half: float, count: int) -> Array:
    return np.clip(((along / half + 1) / 2 * count).astype(np.int32), 0, count - 1)


def _over_support(T: Array, hand: Hand, floor: float | None, error: PoseError) -> Array:
    if floor is None:
        return np.ones(len(T))
    offsets, turns = spread(error, FLOOR_SPREAD)
    missed = np.tile(np.eye(4), (len(offsets), 1, 1))
    missed[:, :3, :3], missed[:, :3, 3] = turns, offsets
    placed = (T[:, None] @ missed).reshape(-1, 4, 4)
    return np.asarray(above(floor, placed, hand, gap=0.0).reshape(len(T), -1).mean(axis=1))


def _palm(points: Array, T: Array, hand: Hand, error: PoseError) -> Array:
    """Chance that the palm's nearest part keeps clear, its room being off by the error of the position."""
    from scipy.special import ndtr

    return np.asarray(ndtr(palm_room(points, T, hand, at_most=REACH * error.position) / error.position))


def _leverage(surface: Surface, T: Array) -> Array:
    offset, closing = surface.centroid - T[:, :3, 3], T[:, :3, 1]
    lever = np.linalg.norm(offset - np.einsum("ki,ki->k", offset, closing)[:, None] * closing, axis=1)
    return np.asarray(1 / (1 + (lever / LEVER) ** 2))
