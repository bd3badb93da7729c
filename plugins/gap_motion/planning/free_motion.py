"""Collision-free timed motions: plan, connect a straight last stretch, time it, and check the timed motion again."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gap_motion.arguments import ArmModel
from gap_motion.collision.checker import CollisionChecker
from gap_motion.kinematics.ik import nearest
from gap_motion.planning.goals import cheapest_free, free_goals, within_limits
from gap_motion.planning.line import follow, interpolate, waypoint_count
from gap_motion.planning.motion_validator import STEP, MotionValidator
from gap_motion.planning.moves import pregrasp_pose
from gap_motion.planning.paths import CORNER, polyline, velocity_limits, without_repeats
from gap_motion.planning.planner import PathSearch, plan, refuse_contact
from gap_motion.planning.planning_scene import PlanningScene
from gap_motion.timing.timing import time_path
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Array, Trajectory

CORNERS = (CORNER, CORNER / 4, CORNER / 40)  # rounding that is tried in turn until the timed motion is free
TRIES = (STEP, STEP / 3, STEP / 6)  # m: how closely a path is checked; another, when its timed motion is not free
CORNER_SAMPLES = 5  # of a trajectory, over which it turns from the planned path into the straight approach
LINES = 2  # straight approaches looked at before planning towards them


class PlannedMotion(NamedTuple):
    """A timed motion and the index of the pose it leads to."""

    trajectory: Trajectory
    pose: int


class Approach(NamedTuple):
    """The straight last stretch to a pose, as joint waypoints (M, n), and the index of the pose."""

    rows: Array
    pose: int


def timed(
    checker: CollisionChecker, waypoints: Array, is_free: Callable[[Trajectory], bool] | None = None
) -> Trajectory | None:
    """The fastest trajectory along (M, n) waypoints that is free all along, or as `is_free` has it; or None."""
    rows = without_repeats(waypoints)
    if len(rows) < 2:
        return Trajectory(np.zeros(1), rows[:1], np.zeros((1, rows.shape[1])))
    for corner in CORNERS if len(rows) > 2 else CORNERS[:1]:
        path = polyline(rows, velocity_limits(checker.chain.spec), corner)
        trajectory = time_path(path, checker.chain)
        if checker.free(trajectory.positions) if is_free is None else is_free(trajectory):
            return trajectory
    return None


def to_joints(checker: CollisionChecker, start: Array, goals: Array, seed: int, improve: bool = False) -> PlannedMotion:
    """A free motion from `start` (n,) to the cheapest reachable of goals (G, n). Raises `PlanningError`."""
    return _connect(checker, start, goals, np.arange(len(goals)), seed, improve)


def to_poses(
    scene: PlanningScene,
    start: Array,
    poses: Array,
    seed: int,
    improve: bool = False,
    search: PathSearch | None = None,
) -> PlannedMotion:
    """A free motion from `start` (n,) to the cheapest reachable of M poses of the frame behind the last joint.

    Raises `PlanningError`: `unreachable`, `limits`, `in_collision`, `no_path`.
    """
    checker = scene.checker(start)
    rows = within_limits(scene.cell.chain, poses, start)
    goals, owner = _flatten(free_goals(checker, rows))
    if not len(goals):
        raise _no_goal(scene.cell, checker, poses, rows, start)
    return _connect(checker, start, goals, owner, seed, improve, search=search)


def to_grasps(
    scene: PlanningScene,
    start: Array,
    grasps: Array,
    approach: float,
    grasped: list[str],
    seed: int,
    search: PathSearch | None = None,
) -> PlannedMotion:
    """As `to_poses`, the last `approach` [m] straight along the TCP's approach axis.

    On that last stretch the gripper may touch what is `grasped`; until then it is an obstacle like any other.
    """
    cell = scene.cell
    free, reaching = scene.checker(start), scene.checker(start, reaching=True, grasped=grasped)
    before = pregrasp_pose(cell, grasps, approach)
    lines: list[Approach] = []
    blocked: PlanningError | None = None
    for q, pose in cheapest_free(free, before, start):
        try:
            line = Approach(approach_line(cell, q, before[pose], grasps[pose]), pose)
            _refuse_approach(reaching, line.rows)
        except PlanningError as error:
            blocked = blocked or error
            continue
        if search is None and MotionValidator(free).free(start, q):
            found = _timed_approach(free, reaching, start[None], line)
            if found is not None:
                return PlannedMotion(found, pose)
        lines.append(line)
        if len(lines) == LINES:
            break
    if not lines:
        raise blocked or _no_goal(cell, free, before, within_limits(cell.chain, before, start), start)
    return _approached(free, reaching, start, lines, seed, search)


def approach_line(cell: ArmModel, q: Array, before: Array, grasp: Array) -> Array:
    """Joint waypoints of the straight line from `before` to `grasp` (4, 4), starting at `q` (n,)."""
    way = interpolate(before @ cell.chain.tcp, grasp @ cell.chain.tcp, waypoint_count(before, grasp))
    return follow(cell.chain, way @ np.linalg.inv(cell.chain.tcp), q, "the approach")


def _refuse_approach(reaching: CollisionChecker, rows: Array) -> None:
    contact = reaching.first_contact(rows)
    if contact is not None:
        raise PlanningError(
            "in_collision",
            f"The approach is in collision: {contact} at waypoint {contact.index} of {len(rows) - 1}.",
            detail={"pair": [contact.link, contact.other], "waypoint": contact.index},
        )


def _connect(
    checker: CollisionChecker,
    start: Array,
    goals: Array,
    owner: Array,
    seed: int,
    improve: bool = False,
    search: PathSearch | None = None,
) -> PlannedMotion:
    """Plan to the goals (G, n), which lead to the poses `owner` (G,), and time the path."""
    for attempt, step in enumerate(TRIES):
        path = plan(checker, start, goals, seed + 7919 * attempt, improve, step, search=search)
        found = timed(checker, path.waypoints)
        if found is not None:
            return PlannedMotion(found, int(owner[path.goal]))
    raise _not_free_in_time()


def _approached(
    free: CollisionChecker,
    reaching: CollisionChecker,
    start: Array,
    lines: list[Approach],
    seed: int,
    search: PathSearch | None,
) -> PlannedMotion:
    """Plan to where one of the straight approaches begins, and time the whole."""
    goals = np.array([line.rows[0] for line in lines])
    for attempt, step in enumerate(TRIES):
        path = plan(free, start, goals, seed + 7919 * attempt, step=step, search=search)
        found = _timed_approach(free, reaching, path.waypoints[:-1], lines[path.goal])
        if found is not None:
            return PlannedMotion(found, lines[path.goal].pose)
    raise _not_free_in_time()


def _timed_approach(
    free: CollisionChecker, reaching: CollisionChecker, way: Array, line: Approach
) -> Trajectory | None:
    """Free until it turns into the straight approach, from there on as free as reaching asks for; or None."""

    def is_free(trajectory: Trajectory) -> bool:
        q = trajectory.positions
        corner = int(np.argmin(np.abs(q - line.rows[0]).max(axis=1)))
        turn = max(1, corner - CORNER_SAMPLES)
        return free.free(q[:turn]) and reaching.free(q[turn:])

    return timed(reaching, np.concatenate([way, line.rows]), is_free)


def _not_free_in_time() -> PlanningError:
    return PlanningError(
        "no_path",
        f"No motion stayed free once it was timed, in {len(TRIES)} tries.",
        hint="Try another seed, or a smaller collision_margin.",
    )


def _flatten(rows: list[Array]) -> tuple[Array, Array]:
    owner = np.repeat(np.arange(len(rows)), [len(q) for q in rows])
    return (np.concatenate(rows) if len(owner) else np.zeros((0, 0))), owner


def _no_goal(cell: ArmModel, checker: CollisionChecker, poses: Array, rows: list[Array], start: Array) -> PlanningError:
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
