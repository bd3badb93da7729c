"""Which of many grasps could be carried out: reachable, free at the grasp and before it, and free in between."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gap_motion.arguments import ArmModel
from gap_motion.collision.checker import CollisionChecker
from gap_motion.planning.goals import free_goals, within_limits
from gap_motion.planning.moves import pregrasp_pose
from gap_runtime.contracts.types import Array

CORRIDOR = 6  # configurations looked at between the approach and the grasp
SAME_FOLD = 1.5  # rad: a larger joint step between them means that the arm folds over on the way


class Feasible(NamedTuple):
    """One entry per grasp: usable at all, grasp and approach reachable and free, share of the corridor in collision."""

    feasible: Array
    grasp: Array
    approach: Array
    corridor: Array


def assess(
    cell: ArmModel, free: CollisionChecker, reaching: CollisionChecker, grasps: Array, offset: float, near: Array
) -> Feasible:
    """Assess M grasps, poses of the frame behind the last joint, approached from `offset` [m] before."""
    count = len(grasps)
    before = pregrasp_pose(cell, grasps, offset)
    rows = within_limits(cell.chain, np.concatenate([before, grasps]), near)
    starts, ends = free_goals(free, rows[:count]), free_goals(reaching, rows[count:])
    has_start, has_end = (np.array([len(q) > 0 for q in side]) for side in (starts, ends))
    corridor = np.ones(count)
    both = [i for i in range(count) if has_start[i] and has_end[i]]
    pairs = [_closest(starts[i], ends[i]) for i in both]
    steady = [k for k, (a, b) in enumerate(pairs) if np.abs(a - b).max() < SAME_FOLD]
    if steady:
        s = np.linspace(0.0, 1.0, CORRIDOR)[:, None]
        ways = np.concatenate([pairs[k][0] + s * (pairs[k][1] - pairs[k][0]) for k in steady])
        blocked = ~reaching.valid(ways).reshape(len(steady), CORRIDOR)
        corridor[[both[k] for k in steady]] = blocked.mean(axis=1)
    return Feasible(has_start & has_end & (corridor == 0.0), has_end, has_start, corridor)


def _closest(a: Array, b: Array) -> tuple[Array, Array]:
    """The pair of configurations, one of each set, that are nearest to each other."""
    gaps = np.abs(a[:, None] - b[None]).max(axis=2)
    i, k = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
    return a[i], b[k]
