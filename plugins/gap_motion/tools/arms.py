"""`robot_control.*` for several arms, and single actions of a learned policy."""

from __future__ import annotations

import numpy as np

from gap_catalogue.robot_control import (
    ApplyPolicyAction,
    ExecuteActionChunk,
    GoToPoseArm,
    GoToPoseBoth,
    MoveToJointsBoth,
)
from gap_motion.arguments import STEP, ArmModel, finite, joints_of, pose_matrix, positive
from gap_motion.planning import moves
from gap_motion.planning.multi_arm import move_together, refuse_meeting_others
from gap_motion.timing.limits import check_trajectory_limits
from gap_motion.timing.policy_step import PolicyStream, begin, checked_action, solve, step, to_rest, wants_closed
from gap_motion.timing.timing import PERIOD, point_to_point
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, JointState

OPENING = 0.02  # a share of the full opening that is worth a command to the gripper


@serves(GoToPoseArm)
def go_to_pose_arm(ctx: ToolContext, request: GoToPoseArm) -> None:
    cell = ArmModel.of(ctx, request.arm_id)
    target = cell.last_joint_frame(pose_matrix(request.pose, "pose"), request.tcp_offset)
    back = _approach(request.z_approach)
    start = cell.wait_until_settled()
    trajectory = moves.to_pose(cell, start, target, back)
    check_trajectory_limits(cell, trajectory, ctx.task, start)
    refuse_meeting_others(ctx, cell, trajectory)
    ctx.raise_if_cancelled()
    if trajectory.duration > 0:
        cell.arm.execute(trajectory)


@serves(GoToPoseBoth)
def go_to_pose_both(ctx: ToolContext, request: GoToPoseBoth) -> None:
    cells = [ArmModel.of(ctx, 0), ArmModel.of(ctx, 1)]
    targets = [
        cell.last_joint_frame(pose_matrix(pose, what), request.tcp_offset)
        for cell, pose, what in zip(
            cells, (request.pose_arm0, request.pose_arm1), ("pose_arm0", "pose_arm1"), strict=True
        )
    ]
    back = _approach(request.z_approach)
    planned = [
        moves.to_pose(cell, cell.wait_until_settled(), target, back)
        for cell, target in zip(cells, targets, strict=True)
    ]
    move_together(ctx, cells, planned, 0.01)


@serves(MoveToJointsBoth)
def move_to_joints_both(ctx: ToolContext, request: MoveToJointsBoth) -> None:
    cells = [ArmModel.of(ctx, 0), ArmModel.of(ctx, 1)]
    goals = [
        joints_of(state, cell.spec, what)
        for cell, state, what in zip(
            cells, (request.joints_arm0, request.joints_arm1), ("joints_arm0", "joints_arm1"), strict=True
        )
    ]
    near = positive(request.tolerance, "tolerance")
    planned = [
        moves.within_steps(
            point_to_point(cell.chain, np.stack([cell.wait_until_settled(), goal])), request.max_steps, cell.spec
        )
        for cell, goal in zip(cells, goals, strict=True)
    ]
    move_together(ctx, cells, planned, near)


@serves(ApplyPolicyAction)
def apply_policy_action(ctx: ToolContext, request: ApplyPolicyAction) -> None:
    values = checked_action(request.action)
    cell = ArmModel.of(ctx, request.arm_id)
    key, grip = f"policy_stream:{request.arm_id}", f"policy_grip:{request.arm_id}"
    stream = ctx.state.get(key)
    if not isinstance(stream, PolicyStream) or not stream.goes_on(cell.arm.setpoint()):
        cell.arm.finish()
        stream = begin(cell)
    stream = step(cell, stream, values)
    ctx.state[key] = PolicyStream(stream.target, _send_on(ctx, cell, stream.goal))
    closed = wants_closed(values)
    if closed is not None and ctx.state.get(grip) != closed:
        (cell.arm.gripper.close if closed else cell.arm.gripper.open)(wait=False)
        ctx.state[grip] = closed
    ctx.cell.wait(STEP)


@serves(ExecuteActionChunk)
def execute_action_chunk(ctx: ToolContext, request: ExecuteActionChunk) -> None:
    chunk, cell = request.chunk, ArmModel.of(ctx, request.arm_id)
    opening, key = chunk.gripper, f"policy_opening:{request.arm_id}"
    for i in range(request.targets):
        seed = cell.arm.setpoint().goal
        if chunk.joints is not None:
            goal = joints_of(JointState(chunk.joints[i]), cell.spec, f"chunk.joints[{i}]")
        else:
            goal = solve(cell, cell.last_joint_frame(pose_matrix(chunk.poses[i], f"chunk.poses[{i}]"), None), seed)
        _send_on(ctx, cell, goal)
        if opening is not None and abs(opening[i] - ctx.state.get(key, np.inf)) > OPENING:
            cell.arm.gripper.set_width(float(opening[i]) * cell.spec.gripper.max_width, wait=False)
            ctx.state[key] = float(opening[i])
        ctx.cell.wait(1.0 / chunk.rate)


def _send_on(ctx: ToolContext, cell: ArmModel, goal: Array) -> Array:
    """Send the arm on to `goal` (n,) from the motion it is in; returns where that motion ends."""
    now = cell.arm.setpoint()
    trajectory = to_rest(cell, now, goal)
    check_trajectory_limits(cell, trajectory, ctx.task, now.positions, now)
    refuse_meeting_others(ctx, cell, moves.sampled(trajectory, PERIOD))
    ctx.raise_if_cancelled()
    cell.arm.start(trajectory, replace=True)
    return cell.arm.setpoint().goal


def _approach(distance: float) -> float:
    if finite(distance, "z_approach") < 0:
        raise BadRequestError("range", f"z_approach must not be negative, got {distance}.")
    return distance


TOOLS = (go_to_pose_arm, go_to_pose_both, move_to_joints_both, apply_policy_action, execute_action_chunk)
