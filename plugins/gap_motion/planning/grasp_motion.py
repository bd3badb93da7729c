"""The three phases of a grasp: freely to before it, straight in, straight away with the object."""

from __future__ import annotations

import numpy as np

from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.world import unknown_obstacle
from gap_motion.planning.free_motion import to_joints
from gap_motion.planning.goals import free_goals, within_limits
from gap_motion.planning.moves import cartesian_line
from gap_motion.planning.planner import refuse_contact
from gap_motion.planning.planning_scene import PlanningScene
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Array, Trajectory, WorldConfig

STARTS = 8  # configurations before the grasp that are tried in turn


def grasp_motion(
    scene: PlanningScene,
    start: Array,
    grasp: Array,
    approach: Array,
    lift: Array,
    config: WorldConfig | None,
    name: str,
    seed: int,
) -> tuple[Trajectory, Trajectory, Trajectory]:
    """Approach, grasp and lift for a TCP pose (4, 4); `approach` and `lift` are straight ways (3,) in the world [m].

    Raises `PlanningError`, `BadRequestError` (`unknown_obstacle`).
    """
    if name and name not in scene.world.names:
        raise unknown_obstacle(name, scene.world.names)
    cell, before, after = scene.cell, grasp.copy(), grasp.copy()
    before[:3, 3] -= approach
    after[:3, 3] += lift
    grasped = [name] if name else scene.graspable(config, grasp[None])
    free, reaching = scene.checker(start), scene.checker(reaching=True, grasped=grasped)
    rows = within_limits(cell.chain, cell.last_joint_frame(before)[None], start)
    if not len(rows[0]):
        cartesian_line(cell, start, cell.last_joint_frame(before))  # says why it cannot be reached
        raise PlanningError("unreachable", "The pose before the grasp has no configuration within the limits.")
    goals = free_goals(free, rows, STARTS)[0]
    if not len(goals):
        refuse_contact(free, rows[0][0], "The arm before the grasp")
    problem: PlanningError | None = None
    for q in goals:
        try:
            down = _checked(reaching, cartesian_line(cell, q, cell.last_joint_frame(grasp)), "grasp")
            at_grasp = down.positions[-1]
            carrying = scene.holding(config, grasped[0], at_grasp) if grasped and config else scene
            up = cartesian_line(cell, at_grasp, cell.last_joint_frame(after))
            up = _checked(carrying.checker(at_grasp, reaching=True, grasped=grasped), up, "lift")
            return to_joints(free, start, q[None], seed).trajectory, down, up
        except PlanningError as error:
            problem = problem or error
    raise problem or PlanningError("no_path", "No configuration before the grasp is free.")


def _checked(checker: CollisionChecker, trajectory: Trajectory, phase: str) -> Trajectory:
    contact = checker.first_contact(np.asarray(trajectory.positions))
    if contact is not None:
        raise PlanningError(
            "in_collision",
            f"The {phase} is in collision: {contact} at waypoint {contact.index} of {len(trajectory.times) - 1}.",
            detail={"pair": [contact.link, contact.other], "waypoint": contact.index, "phase": phase},
        )
    return trajectory
