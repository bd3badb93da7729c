"""`curobo.*` served on the CPU, part two: straight lines, constrained lines and the three phases of a grasp."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_motion.arguments import ArmModel, finite, joints_of, pose_matrix, positive, unit_vector
from gap_motion.collision.checker import MARGIN
from gap_motion.planning.cartesian_constraints import directed_end, held_end
from gap_motion.planning.grasp_motion import grasp_motion
from gap_motion.planning.moves import straight
from gap_motion.planning.planning_scene import Situation
from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, Array, JointState, Se3Pose, Trajectory, Vec3, WorldConfig

MOST_WAYPOINTS = 1000
START = 0.01  # m, and 10 times that in rad: how far start_pose may be from where start_joint_position puts the TCP
ALONG_TOOL, UP = Vec3(0.0, 0.0, 1.0), Vec3(0.0, 0.0, 1.0)


class Line(NamedTuple):
    """A timed line, or why there is none ("code: why")."""

    success: bool
    trajectory: Trajectory
    failure_reason: str


class GraspMotion(NamedTuple):
    """Three timed motions, each starting where the one before ends, or why there are none ("code: why")."""

    success: bool
    approach_trajectory: Trajectory
    grasp_trajectory: Trajectory
    lift_trajectory: Trajectory
    failure_reason: str


@tool("curobo.PlanLinear", effect="sense", deadline_s=20.0)
def plan_linear(
    ctx: ToolContext,
    start_pose: Annotated[Se3Pose, WORLD],
    end_pose: Annotated[Se3Pose, WORLD],
    start_joint_position: JointState,
    world_config: WorldConfig | None = None,
    num_waypoints: int = 20,
    hold_vec_weight: list[float] | None = None,
    collision_margin: float = MARGIN,
    arm_id: int = 0,
) -> Line:
    """A timed straight line of the TCP from where `start_joint_position` puts it, checked where there is a world.

    `hold_vec_weight` (rotation x y z, translation x y z, in the end pose's frame) keeps axes of positive weight as they
    are at the start. Raises `BadRequestError`; other failures are told in `failure_reason`.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    if not 2 <= num_waypoints <= MOST_WAYPOINTS:
        raise BadRequestError("range", f"num_waypoints must be 2 to {MOST_WAYPOINTS}, got {num_waypoints}.")
    start = joints_of(start_joint_position, situation.cell.spec, "start_joint_position")
    first, last = pose_matrix(start_pose, "start_pose"), pose_matrix(end_pose, "end_pose")
    return _line(situation, start, first, held_end(first, last, hold_vec_weight), num_waypoints)


@tool("curobo.PlanDirectedLinear", effect="sense", deadline_s=20.0)
def plan_directed_linear(
    ctx: ToolContext,
    start_joint_position: JointState,
    start_pose: Annotated[Se3Pose, WORLD],
    target_pose: Annotated[Se3Pose, WORLD],
    allowed_axes: list[str],
    endpoint_mode: str = "project_to_target",
    orientation_mode: str = "hold",
    distance: float = 0.0,
    world_config: WorldConfig | None = None,
    collision_margin: float = MARGIN,
    arm_id: int = 0,
) -> Line:
    """A timed line of the TCP along some world axes alone (`allowed_axes`, of "x", "y", "z").

    `endpoint_mode`: `project_to_target` goes as far towards the target as those axes lead, `fixed_distance` goes
    `distance` [m] that way, `orient_in_place` turns to the target's orientation and stays. `orientation_mode`: `hold`
    or `target`. Raises `BadRequestError`; other failures are told in `failure_reason`.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    start = joints_of(start_joint_position, situation.cell.spec, "start_joint_position")
    first, target = pose_matrix(start_pose, "start_pose"), pose_matrix(target_pose, "target_pose")
    end = directed_end(first, target, allowed_axes, endpoint_mode, orientation_mode, finite(distance, "distance"))
    return _line(situation, start, first, end, 0)


@tool("curobo.PlanGraspMotion", effect="sense", deadline_s=20.0)
def plan_grasp_motion(
    ctx: ToolContext,
    start_joint_position: JointState,
    grasp_pose: Annotated[Se3Pose, WORLD],
    approach_axis: Vec3 = ALONG_TOOL,
    approach_distance: float = 0.12,
    lift_axis: Vec3 = UP,
    lift_distance: float = 0.20,
    world_config: WorldConfig | None = None,
    object_name: str = "",
    collision_margin: float = MARGIN,
    seed: int = 0,
    arm_id: int = 0,
) -> GraspMotion:
    """A grasp in three timed motions, so that the caller can move the gripper between them.

    Freely to `approach_distance` [m] before the grasp; straight along `approach_axis` (in the TCP's frame) to the
    grasp, where the gripper may touch `object_name` (default: the obstacle the grasp is in); straight along `lift_axis`
    (in the world) by `lift_distance` [m], carrying it. Raises `BadRequestError`; other failures are told in
    `failure_reason`.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    spec = situation.cell.spec
    start = joints_of(start_joint_position, spec, "start_joint_position")
    grasp = pose_matrix(grasp_pose, "grasp_pose")
    approach = (
        grasp[:3, :3] @ unit_vector(approach_axis, "approach_axis") * positive(approach_distance, "approach_distance")
    )
    lift = unit_vector(lift_axis, "lift_axis") * positive(lift_distance, "lift_distance")
    try:
        phases = grasp_motion(situation, start, grasp, approach, lift, world_config, object_name, seed)
    except PlanningError as error:
        nothing = _nothing(spec.dof)
        return GraspMotion(False, nothing, nothing, nothing, f"{error.code}: {error.message}")
    return GraspMotion(True, *phases, "")


def _line(situation: Situation, start: Array, first: Array, end: Array, count: int) -> Line:
    cell: ArmModel = situation.cell
    try:
        _starts_there(cell, start, first)
        checker = situation.checker(start)
        trajectory = straight(cell, start, cell.last_frame(end), count)
        contact = checker.first_contact(trajectory.positions)
    except PlanningError as error:
        return Line(False, _nothing(cell.spec.dof), f"{error.code}: {error.message}")
    if contact is not None:
        where = f"{contact} at waypoint {contact.index} of {len(trajectory.times) - 1}"
        return Line(False, _nothing(cell.spec.dof), f"in_collision: {where}.")
    return Line(True, trajectory, "")


def _starts_there(cell: ArmModel, start: Array, pose: Array) -> None:
    T = cell.tcp(start)[0]
    off = float(np.linalg.norm(T[:3, 3] - pose[:3, 3]))
    turned = float(np.linalg.norm(T[:3, :3] - pose[:3, :3]))
    if off > START or turned > 10 * START:
        raise PlanningError(
            "start_mismatch", f"start_joint_position puts the TCP {off:.3f} m from start_pose, or turned away from it."
        )


def _nothing(dof: int) -> Trajectory:
    return Trajectory(np.zeros(0), np.zeros((0, dof)))


TOOLS = (plan_linear, plan_directed_linear, plan_grasp_motion)
