"""`curobo.*` served on the CPU, part two: straight lines, constrained lines and the three phases of a grasp."""

from __future__ import annotations

import numpy as np

from gap_catalogue.curobo import CuroboPlanLinear, GraspPhases, LinePlan, PlanDirectedLinear, PlanGraspMotion
from gap_motion.arguments import ArmModel, finite, joints_of, pose_matrix, positive, unit_vector
from gap_motion.planning.cartesian_constraints import directed_end, held_end
from gap_motion.planning.grasp_motion import grasp_motion
from gap_motion.planning.moves import cartesian_line
from gap_motion.planning.planning_scene import PlanningScene
from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, Trajectory

MOST_WAYPOINTS = 1000
START = 0.01  # m, and 10 times that in rad: how far start_pose may be from where start_joint_position puts the TCP


@serves(CuroboPlanLinear)
def plan_linear(ctx: ToolContext, request: CuroboPlanLinear) -> LinePlan:
    scene = PlanningScene.of(ctx, request)
    if not 2 <= request.num_waypoints <= MOST_WAYPOINTS:
        raise BadRequestError("range", f"num_waypoints must be 2 to {MOST_WAYPOINTS}, got {request.num_waypoints}.")
    start = joints_of(request.start_joint_position, scene.cell.spec, "start_joint_position")
    first, last = pose_matrix(request.start_pose, "start_pose"), pose_matrix(request.end_pose, "end_pose")
    return _line(scene, start, first, held_end(first, last, request.hold_vec_weight), request.num_waypoints)


@serves(PlanDirectedLinear)
def plan_directed_linear(ctx: ToolContext, request: PlanDirectedLinear) -> LinePlan:
    scene = PlanningScene.of(ctx, request)
    start = joints_of(request.start_joint_position, scene.cell.spec, "start_joint_position")
    first, target = pose_matrix(request.start_pose, "start_pose"), pose_matrix(request.target_pose, "target_pose")
    distance = finite(request.distance, "distance")
    end = directed_end(first, target, request.allowed_axes, request.endpoint_mode, request.orientation_mode, distance)
    return _line(scene, start, first, end, 0)


@serves(PlanGraspMotion)
def plan_grasp_motion(ctx: ToolContext, request: PlanGraspMotion) -> GraspPhases:
    scene = PlanningScene.of(ctx, request)
    spec = scene.cell.spec
    start = joints_of(request.start_joint_position, spec, "start_joint_position")
    grasp = pose_matrix(request.grasp_pose, "grasp_pose")
    along = grasp[:3, :3] @ unit_vector(request.approach_axis, "approach_axis")
    approach = along * positive(request.approach_distance, "approach_distance")
    lift = unit_vector(request.lift_axis, "lift_axis") * positive(request.lift_distance, "lift_distance")
    try:
        phases = grasp_motion(
            scene, start, grasp, approach, lift, request.world_config, request.object_name, request.seed
        )
    except PlanningError as error:
        nothing = _nothing(spec.dof)
        return GraspPhases(False, nothing, nothing, nothing, f"{error.code}: {error.message}")
    return GraspPhases(True, *phases, "")


def _line(scene: PlanningScene, start: Array, first: Array, end: Array, count: int) -> LinePlan:
    cell: ArmModel = scene.cell
    try:
        _starts_there(cell, start, first)
        checker = scene.checker(start)
        trajectory = cartesian_line(cell, start, cell.last_joint_frame(end), count)
        contact = checker.first_contact(trajectory.positions)
    except PlanningError as error:
        return LinePlan(False, _nothing(cell.spec.dof), f"{error.code}: {error.message}")
    if contact is not None:
        where = f"{contact} at waypoint {contact.index} of {len(trajectory.times) - 1}"
        return LinePlan(False, _nothing(cell.spec.dof), f"in_collision: {where}.")
    return LinePlan(True, trajectory, "")


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
