"""Collision-free timed motions: plan, connect a straight last stretch, time it, and check the timed motion again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gap_cli.contracts.failures import PlanningError
from gap_cli.contracts.types import Array, Trajectory
from gap_motion.checker import Checker
from gap_motion.edges import STEP
from gap_motion.goals import free_goals, within_limits
from gap_motion.ik import nearest
from gap_motion.line import follow, interpolate, waypoint_count
from gap_motion.moves import back_off
from gap_motion.paths import CORNER, polyline, velocity_limits, without_repeats
from gap_motion.planner import Search, plan, refuse_contact
from gap_motion.requests import Cell
from gap_motion.situation import Situation
from gap_motion.timing import time_path

CORNERS = (CORNER, CORNER / 4, CORNER / 40)  # rounding that is tried in turn until the timed motion is free
TRIES = (STEP, STEP / 3, STEP / 6)  # m: how closely a path is checked; another, when its timed motion is not free
CORNER_SAMPLES = 5  # of a trajectory, over which it turns from the planned path into the straight approach
LINES = 2  # straight approaches looked at before planning towards them


class Reached(NamedTuple):
    """A timed motion and the index of the pose it leads to."""

    trajectory: Trajectory
    pose: int


def timed(checker: Checker, waypoints: Array) -> Trajectory | None:
    """The fastest trajectory along (M, n) waypoints that is free all along, or None."""
    rows = without_repeats(waypoints)
    if len(rows) < 2:
        return Trajectory(np.zeros(1), rows[:1], np.zeros((1, rows.shape[1])))
    for corner in CORNERS if len(rows) > 2 else CORNERS[:1]:
        path = polyline(rows, velocity_limits(checker.chain.spec), corner)
        trajectory = time_path(path, checker.chain)
        if checker.free(trajectory.positions):
            return trajectory
    return None


def to_joints(checker: Checker, start: Array, goals: Array, seed: int, improve: bool = False) -> Reached:
    """A free motion from `start` (n,) to the cheapest reachable of goals (G, n). Raises `PlanningError`."""
    return _connect(checker, start, goals, np.arange(len(goals)), seed, improve)


def to_poses(
    situation: Situation,
    start: Array,
    poses: Array,
    seed: int,
    improve: bool = False,
    search: Search | None = None,
) -> Reached:
    """A free motion from `start` (n,) to the cheapest reachable of M poses of the frame behind the last joint.

    Raises `PlanningError`: `unreachable`, `limits`, `in_collision`, `no_path`.
    """
    checker = situation.checker(start)
    rows = within_limits(situation.cell.chain, poses, start)
    goals, owner = _flatten(free_goals(checker, rows))
    if not len(goals):
        raise _no_goal(situation.cell, checker, poses, rows, start)
    return _connect(checker, start, goals, owner, seed, improve, search=search)


def to_grasps(
    situation: Situation,
    start: Array,
    grasps: Array,
    approach: float,
    grasped: list[str],
    seed: int,
    search: Search | None = None,
) -> Reached:
    """As `to_poses`, the last `approach` [m] straight along the TCP's approach axis.

    On that last stretch the gripper may touch what is `grasped`; until then it is an obstacle like any other.
    """
    cell = situation.cell
    free, reaching = situation.checker(start), situation.checker(start, reaching=True, grasped=grasped)
    before = np.stack([back_off(cell, T, approach) for T in grasps])
    rows = within_limits(cell.chain, before, start)
    candidates, owner = _flatten(free_goals(free, rows))
    order = np.argsort([np.abs(q - start).max() for q in candidates], kind="stable")
    goals, ends, tails, blocked = [], [], [], None
    for k in order:
        try:
            tail = approach_line(cell, candidates[k], before[owner[k]], grasps[owner[k]])
        except PlanningError as error:
            blocked = blocked or error
            continue
        contact = reaching.first_contact(tail)
        if contact is not None:
            blocked = blocked or PlanningError("in_collision", f"The approach is in collision: {contact}.")
            continue
        goals.append(candidates[k])
        ends.append(int(owner[k]))
        tails.append(tail)
        if len(goals) == LINES:
            break
    if not goals:
        raise blocked or _no_goal(cell, free, before, rows, start)
    return _connect(free, start, np.array(goals), np.array(ends), seed, tails=tails, reaching=reaching, search=search)


def approach_line(cell: Cell, q: Array, before: Array, grasp: Array) -> Array:
    """Joint waypoints of the straight line from `before` to `grasp` (4, 4), starting at `q` (n,)."""
    way = interpolate(before @ cell.chain.tcp, grasp @ cell.chain.tcp, waypoint_count(before, grasp))
    return follow(cell.chain, way @ np.linalg.inv(cell.chain.tcp), q, "the approach")


def _connect(
    checker: Checker,
    start: Array,
    goals: Array,
    owner: Array,
    seed: int,
    improve: bool = False,
    tails: Sequence[Array] = (),
    reaching: Checker | None = None,
    search: Search | None = None,
) -> Reached:
    """Plan to the goals, append the chosen one's straight tail, if any, and time the whole."""
    for attempt, step in enumerate(TRIES):
        path = plan(checker, start, goals, seed + 7919 * attempt, improve, step, search=search)
        if reaching is None:
            found = timed(checker, path.waypoints)
        else:
            tail = tails[path.goal]
            found = timed(reaching, np.concatenate([path.waypoints, tail[1:]]))
            if found is not None and not checker.free(_before(found, tail[0])):
                found = None
        if found is not None:
            return Reached(found, int(owner[path.goal]))
    raise PlanningError(
        "no_path",
        f"No motion stayed free once it was timed, in {len(TRIES)} tries.",
        hint="Try another seed, or a smaller collision_margin.",
    )


def _before(trajectory: Trajectory, q: Array) -> Array:
    """The samples of a trajectory up to where it rounds the corner at `q` (n,), and the first one at least."""
    corner = int(np.argmin(np.abs(trajectory.positions - q).max(axis=1)))
    return trajectory.positions[: max(1, corner - CORNER_SAMPLES)]


def _flatten(rows: list[Array]) -> tuple[Array, Array]:
    owner = np.repeat(np.arange(len(rows)), [len(q) for q in rows])
    return (np.concatenate(rows) if len(owner) else np.zeros((0, 0))), owner


def _no_goal(cell: Cell, checker: Checker, poses: Array, rows: list[Array], start: Array) -> PlanningError:
    """Why none of the poses has a free configuration, told of the first that can be reached at all."""
    reached = next((q for q in rows if len(q)), None)
    try:
        if reached is None:
            nearest(cell.chain, poses[0], start, "The goal" if len(poses) == 1 else f"Any of {len(poses)} goals")
        else:
            refuse_contact(checker, reached[0], "The goal" if len(poses) == 1 else f"Each of {len(poses)} goals")
    except PlanningError as error:
        return error
    return PlanningError("no_path", "No goal configuration was found.")
