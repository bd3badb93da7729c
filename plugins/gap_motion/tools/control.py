"""`robot_control.*` for one arm: every motion is planned, timed and checked whole before the arm is asked to move."""

from __future__ import annotations

import numpy as np

from gap_catalogue.robot_control import (
    ExecuteJointTrajectory,
    GetEEPose,
    GoHome,
    GoToPose,
    GoToPoseCartesian,
    MoveToJoints,
    TcpPose,
)
from gap_motion.arguments import ArmModel, arm_of, finite, joints_of, pose_matrix, positive, trajectory_of
from gap_motion.planning import moves
from gap_motion.planning.multi_arm import move_together, refuse_meeting_others
from gap_motion.timing.limits import check_trajectory_limits
from gap_motion.timing.timing import point_to_point
from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, Trajectory

ARM = ("arm:0", "clock")


@serves(GetEEPose)
def get_ee_pose(ctx: ToolContext, request: GetEEPose) -> TcpPose:
    return TcpPose(arm_of(ctx, request.arm_id).state().ee_pose)


@serves(GoToPose)
def go_to_pose(ctx: ToolContext, request: GoToPose) -> None:
    cell = ArmModel.of(ctx, 0)
    if finite(request.z_approach, "z_approach") < 0:
        raise BadRequestError("range", f"z_approach must not be negative, got {request.z_approach}.")
    target = cell.last_joint_frame(pose_matrix(request.pose, "pose"), request.tcp_offset)
    near = positive(request.tolerance, "tolerance")
    start = cell.wait_until_settled()
    trajectory = moves.within_steps(
        moves.to_pose(cell, start, target, request.z_approach), request.max_steps, cell.spec
    )
    _run(ctx, cell, trajectory, start, near, request.nonblocking)


@serves(GoToPoseCartesian)
def go_to_pose_cartesian(ctx: ToolContext, request: GoToPoseCartesian) -> None:
    cell = ArmModel.of(ctx, 0)
    speed, turning = positive(request.lin_vel_norm, "lin_vel_norm"), positive(request.ang_vel_norm, "ang_vel_norm")
    longest, target = positive(request.timeout_s, "timeout_s"), cell.last_joint_frame(pose_matrix(request.pose, "pose"))
    start = cell.wait_until_settled()
    trajectory = moves.cartesian_line(cell, start, target, speed=speed, turning=turning)
    if trajectory.duration > longest:
        raise PlanningError(
            "budget", f"The line takes {trajectory.duration:.2f} s, more than timeout_s = {request.timeout_s}."
        )
    _run(ctx, cell, trajectory, start)


@serves(ExecuteJointTrajectory)
def execute_joint_trajectory(ctx: ToolContext, request: ExecuteJointTrajectory) -> None:
    cell = ArmModel.of(ctx, 0)
    if request.subsample < 1:
        raise BadRequestError("range", f"subsample must be at least 1, got {request.subsample}.")
    planned = trajectory_of(request.trajectory, cell.spec)
    keep = np.unique(np.append(np.arange(0, len(planned.times), request.subsample), len(planned.times) - 1))
    velocities = None if planned.velocities is None else planned.velocities[keep]
    near = positive(request.tolerance, "tolerance")
    start = cell.wait_until_settled()
    _run(ctx, cell, Trajectory(planned.times[keep], planned.positions[keep], velocities), start, near)


@serves(MoveToJoints)
def move_to_joints(ctx: ToolContext, request: MoveToJoints) -> None:
    cell = ArmModel.of(ctx, 0)
    goal = joints_of(request.joint_config, cell.spec, "joint_config")
    near = positive(request.tolerance, "tolerance")
    start = cell.wait_until_settled()
    planned = moves.within_steps(point_to_point(cell.chain, np.stack([start, goal])), request.max_steps, cell.spec)
    _run(ctx, cell, planned, start, near)


@serves(GoHome)
def go_home(ctx: ToolContext, request: GoHome) -> None:
    cells = [ArmModel.of(ctx, arm_id) for arm_id in range(len(ctx.cell.arms))]
    homes = [np.array(ctx.task.robots[cell.arm_id].home or cell.spec.home) for cell in cells]
    planned = [
        point_to_point(cell.chain, np.stack([cell.wait_until_settled(), home]))
        for cell, home in zip(cells, homes, strict=True)
    ]
    if len(cells) == 1:
        _run(ctx, cells[0], planned[0], cells[0].joints())
    else:
        move_together(ctx, cells, planned, 0.01)


def _run(
    ctx: ToolContext,
    cell: ArmModel,
    planned: Trajectory,
    start: Array,
    tolerance: float = 0.01,
    nonblocking: bool = False,
) -> None:
    ctx.raise_if_cancelled()
    check_trajectory_limits(cell, planned, ctx.task, start)
    if len(planned.times) < 2:
        return
    refuse_meeting_others(ctx, cell, planned)
    (cell.arm.start if nonblocking else cell.arm.execute)(planned, tolerance=tolerance)


TOOLS = (
    get_ee_pose,
    go_to_pose,
    go_to_pose_cartesian,
    execute_joint_trajectory,
    move_to_joints,
    go_home,
)
