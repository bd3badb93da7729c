"""Straight-line motion of the TCP: inverse kinematics that stays on one branch all the way."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from gap_catalogue.shared.robot_chain import Chain
from gap_motion.kinematics.damped_least_squares import damped_least_squares
from gap_motion.kinematics.ik import TURN, candidates_at, cost, free_joint_grid, inside, nearest
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Array

SPACING, TURNING = 0.01, 0.05  # m, rad between the waypoints that inverse kinematics is solved at
AT_LEAST, AT_MOST = 9, 150
JUMP = 0.35  # rad: a larger joint step between neighbouring waypoints is a change of branch
FREE_RANGE, FREE_COUNT = 1.2, 17  # rad, values: how far the free joint may drift over a line
SAME = 1e-12  # between entries of two rotation matrices: the line does not turn
DETOUR = 2.0  # times the direct joint distance: a longer line is tried again by tracking


def interpolate(start: Array, end: Array, count: int) -> Array:
    """Poses (count, 4, 4) from start to end: straight in position, constant axis in rotation."""
    s = np.linspace(0.0, 1.0, count)
    T = np.tile(start, (count, 1, 1))
    if np.abs(end[:3, :3] - start[:3, :3]).max() > SAME:
        T[:, :3, :3] = Slerp([0, 1], Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3]])))(s).as_matrix()
    T[:, :3, 3] = start[:3, 3] + s[:, None] * (end[:3, 3] - start[:3, 3])
    return T


def waypoint_count(start: Array, end: Array) -> int:
    """How many waypoints a line needs."""
    distance = np.linalg.norm(end[:3, 3] - start[:3, 3])
    angle = np.arccos(np.clip((np.trace(end[:3, :3] @ start[:3, :3].T) - 1) / 2, -1.0, 1.0))
    return int(np.clip(1 + np.ceil(max(distance / SPACING, angle / TURNING)), AT_LEAST, AT_MOST))


def follow(chain: Chain, poses: Array, start: Array, what: str = "the line") -> Array:
    """Joint waypoints (M, n) that put the frame behind the last joint at `poses` (M, 4, 4) in turn, from `start` on.

    `start` (n,) is a configuration at the first pose. Raises `PlanningError`: `unreachable` or `limits` for a pose
    out of range, with its waypoint in `detail`; `no_path` when only a change of branch would get there.
    """
    found = _follow_branches(chain, poses, start)
    if found is not None and _length(chain, found) < DETOUR * _length(chain, found[[0, -1]]):
        return found
    # Near an upright upper arm the closed form's branches swing the first and third joint against each other.
    try:
        tracked = _track(chain, poses, start, what)
    except PlanningError:
        if found is None:
            raise
        return found
    return tracked if found is None or _length(chain, tracked) < _length(chain, found) else found


def _length(chain: Chain, q: Array) -> float:
    """Length of a joint path (M, n) [s at full speed]."""
    return float((np.abs(np.diff(q, axis=0)) / chain.velocity).max(axis=1).sum())


def _follow_branches(chain: Chain, poses: Array, start: Array) -> Array | None:
    """The cheapest of a fan of drifts of the free joint that stays on the branch of `start`; None where none does."""
    free = free_joint_grid(chain, float(start[-1]), FREE_RANGE, FREE_COUNT)
    if free is None:
        return None
    ramp = np.linspace(0.0, 1.0, len(poses))[:, None]
    found = candidates_at(chain, poses, start[-1] + ramp * (free - start[-1]))  # (M, K, branches, n)
    q, every = np.broadcast_to(start, (len(free), chain.dof)), np.arange(len(free))
    rows, alive, length = [q], np.ones(len(free), dtype=bool), np.zeros(len(free))
    for step in range(1, len(poses)):
        way = found[step] - q[:, None]
        way -= TURN * np.round(way / TURN)
        gap = np.abs(way).max(axis=-1)
        gap[np.isnan(gap)] = np.inf
        options, pick = q[:, None] + way, gap.argmin(axis=1)
        alive = alive & (gap[every, pick] < JUMP) & inside(chain, options[every, pick])
        if not alive.any():
            return None
        q = np.where(alive[:, None], options[every, pick], q)
        length += (np.abs(q - rows[-1]) / chain.velocity).max(axis=1)
        rows.append(q)
    price = np.where(alive, length + cost(chain, q, q), np.inf)
    return np.stack(rows)[:, int(np.argmin(price))]


def _track(chain: Chain, poses: Array, start: Array, what: str) -> Array:
    """Waypoint by waypoint with damped least squares: any arm, and through singularities of the closed forms."""
    rows = [start]
    for step in range(1, len(poses)):
        q = damped_least_squares(chain, poses[step : step + 1], rows[-1][None], (chain.low, chain.high), iterations=30)[
            0
        ]
        if np.isnan(q).any() or np.abs(q - rows[-1]).max() > JUMP:
            raise _stuck(chain, poses, step, rows[-1][None], what)
        rows.append(q)
    return np.array(rows)


def _stuck(chain: Chain, poses: Array, step: int, last: Array, what: str) -> PlanningError:
    """Say why a waypoint cannot be reached from the one before."""
    where = f"waypoint {step} of {len(poses) - 1} of {what}"
    try:
        nearest(chain, poses[step], last[0], where)
    except PlanningError as error:
        error.detail["waypoint"] = step
        return error
    return PlanningError(
        "no_path",
        f"{where[0].upper()}{where[1:]} can only be reached by folding the arm over.",
        hint="Move there freely (joint motion), or start the line from another configuration.",
        detail={"waypoint": step},
    )
