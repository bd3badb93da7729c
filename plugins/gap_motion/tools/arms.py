"""`robot_control.*` for several arms, and single actions of a learned policy."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gap_motion.arguments import STEP, ArmModel, finite, joints_of, pose_matrix, positive
from gap_motion.planning import moves
from gap_motion.planning.multi_arm import move_together, refuse_meeting_others
from gap_motion.ready import at_rest
from gap_motion.timing.limits import refuse
from gap_motion.timing.policy_step import Stream, begin, checked_action, solve, step, to_rest, wants_closed
from gap_motion.timing.timing import PERIOD, point_to_point
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, ActionChunk, Array, JointState, Se3Pose, Vec3

BOTH = ("arm:0", "arm:1", "clock")
MAX_RATE = 100.0  # Hz: of a chunk's targets, each of which is a motion planned anew
OPENING = 0.02  # a share of the full opening that is worth a command to the gripper


@tool("robot_control.GoToPoseArm", effect="actuate", resources=("arm:{arm_id}", "clock"), deadline_s=60.0)
def go_to_pose_arm(
    ctx: ToolContext,
    arm_id: int,
    pose: Annotated[Se3Pose, WORLD],
    z_approach: float = 0.0,
    tcp_offset: Vec3 | None = None,
) -> None:
    """Move one arm's TCP to a pose by joint motion to the nearest IK solution, with no collision avoidance.

    Arguments as in GoToPose. Raises `BadRequestError` (`unknown_arm`, ...), `PlanningError`, `MotionError`.
    """
    cell = ArmModel.of(ctx, arm_id)
    target = cell.last_frame(pose_matrix(pose, "pose"), tcp_offset)
    back = _approach(z_approach)
    start = at_rest(cell)
    trajectory = moves.to_pose(cell, start, target, back)
    refuse(cell, trajectory, ctx.task, start)
    refuse_meeting_others(ctx, cell, trajectory)
    ctx.raise_if_cancelled()
    if trajectory.duration > 0:
        cell.arm.execute(trajectory)


@tool("robot_control.GoToPoseBoth", effect="actuate", resources=BOTH, deadline_s=60.0)
def go_to_pose_both(
    ctx: ToolContext,
    pose_arm0: Annotated[Se3Pose, WORLD],
    pose_arm1: Annotated[Se3Pose, WORLD],
    z_approach: float = 0.0,
    tcp_offset: Vec3 | None = None,
) -> None:
    """Move the TCPs of arms 0 and 1 to their poses at the same time, in lock-step: both start and end together.

    Arguments as in GoToPose. Refused when the arms would meet. Raises `BadRequestError`, `PlanningError`,
    `MotionError`.
    """
    cells = [ArmModel.of(ctx, 0), ArmModel.of(ctx, 1)]
    targets = [
        cell.last_frame(pose_matrix(pose, what), tcp_offset)
        for cell, pose, what in zip(cells, (pose_arm0, pose_arm1), ("pose_arm0", "pose_arm1"), strict=True)
    ]
    back = _approach(z_approach)
    planned = [moves.to_pose(cell, at_rest(cell), target, back) for cell, target in zip(cells, targets, strict=True)]
    move_together(ctx, cells, planned, 0.01)


@tool("robot_control.MoveToJointsBoth", effect="actuate", resources=BOTH, deadline_s=60.0)
def move_to_joints_both(
    ctx: ToolContext, joints_arm0: JointState, joints_arm1: JointState, tolerance: float = 0.02, max_steps: int = 300
) -> None:
    """Move arms 0 and 1 straight in joint space to configurations at the same time, in lock-step.

    One of `max_steps` is 50 ms of planned motion. Refused when the arms would meet. Raises `BadRequestError`,
    `PlanningError` (`budget`), `MotionError`.
    """
    cells = [ArmModel.of(ctx, 0), ArmModel.of(ctx, 1)]
    goals = [
        joints_of(state, cell.spec, what)
        for cell, state, what in zip(cells, (joints_arm0, joints_arm1), ("joints_arm0", "joints_arm1"), strict=True)
    ]
    near = positive(tolerance, "tolerance")
    planned = [
        moves.within_steps(point_to_point(cell.chain, np.stack([at_rest(cell), goal])), max_steps)
        for cell, goal in zip(cells, goals, strict=True)
    ]
    move_together(ctx, cells, planned, near)


@tool("robot_control.ApplyPolicyAction", effect="actuate", resources=("arm:{arm_id}", "gripper:{arm_id}", "clock"))
def apply_policy_action(ctx: ToolContext, action: list[float], arm_id: int = 0) -> None:
    """Carry out one action of a policy at 20 Hz: [dx dy dz, rx ry rz, grip], entries in [-1, 1].

    An entry of 1 moves the target of the TCP 5 cm along, or turns it 0.5 rad about, an axis of the arm's base; targets
    add up. The arm is sent on to the target from the motion it is in, inside all limits, to be there 0.15 s later or as
    soon as it can; 50 ms of world time pass, and the next action goes on from there. When none follows, the arm comes
    to rest at the target while time passes or before its next command. Grip below 0 opens, above 0 closes, meanwhile.
    Refused whole outside the arm's limits or the workspace, near another arm, and (`rate`) when the arm would fall 1 s
    behind.
    Raises `BadRequestError`, `PlanningError`, `MotionError`.
    """
    values = checked_action(action)
    cell = ArmModel.of(ctx, arm_id)
    key, grip = f"policy_stream:{arm_id}", f"policy_grip:{arm_id}"
    stream = ctx.state.get(key)
    if not isinstance(stream, Stream) or not stream.goes_on(cell.arm.setpoint()):
        cell.arm.finish()
        stream = begin(cell)
    stream = step(cell, stream, values)
    ctx.state[key] = Stream(stream.target, _send_on(ctx, cell, stream.goal))
    closed = wants_closed(values)
    if closed is not None and ctx.state.get(grip) != closed:
        (cell.arm.gripper.close if closed else cell.arm.gripper.open)(wait=False)
        ctx.state[grip] = closed
    ctx.cell.wait(STEP)


@tool("robot_control.ExecuteActionChunk", effect="actuate",
      resources=("arm:{arm_id}", "gripper:{arm_id}", "clock"), deadline_s=60.0)  # fmt: skip
def execute_action_chunk(ctx: ToolContext, chunk: ActionChunk, arm_id: int = 0) -> None:
    """Follow the targets of a policy's chunk at its rate, from the motion the arm is in and without stopping between.

    After the last one the arm comes to rest at it, unless the next chunk takes over in time. Refused where
    ApplyPolicyAction is, before the first target that cannot be followed. Raises `BadRequestError` (`range`, `shape`),
    `PlanningError`, `MotionError`.
    """
    cell = ArmModel.of(ctx, arm_id)
    if not positive(chunk.rate, "chunk.rate") <= MAX_RATE:
        raise BadRequestError("range", f"chunk.rate is {chunk.rate:g} Hz, more than {MAX_RATE:g} Hz.")
    count = len(chunk.poses) if chunk.joints is None else len(chunk.joints)
    if chunk.joints is not None and chunk.poses:
        raise BadRequestError("shape", "The chunk holds joints and poses; one of them can be followed.")
    opening = None if chunk.gripper is None else chunk.gripper
    if opening is not None and (opening.shape != (count,) or not ((opening >= 0) & (opening <= 1)).all()):
        raise BadRequestError("range", f"chunk.gripper must hold {count} openings between 0 (closed) and 1 (open).")
    key = f"policy_opening:{arm_id}"
    for i in range(count):
        seed = cell.arm.setpoint().goal
        if chunk.joints is not None:
            goal = joints_of(JointState(chunk.joints[i]), cell.spec, f"chunk.joints[{i}]")
        else:
            goal = solve(cell, cell.last_frame(pose_matrix(chunk.poses[i], f"chunk.poses[{i}]"), None), seed)
        _send_on(ctx, cell, goal)
        if opening is not None and abs(opening[i] - ctx.state.get(key, np.inf)) > OPENING:
            cell.arm.gripper.set_width(float(opening[i]) * cell.spec.gripper.max_width, wait=False)
            ctx.state[key] = float(opening[i])
        ctx.cell.wait(1.0 / chunk.rate)


def _send_on(ctx: ToolContext, cell: ArmModel, goal: Array) -> Array:
    """Send the arm on to `goal` (n,) from the motion it is in; returns where that motion ends."""
    now = cell.arm.setpoint()
    trajectory = to_rest(cell, now, goal)
    refuse(cell, trajectory, ctx.task, now.positions, now)
    refuse_meeting_others(ctx, cell, moves.sampled(trajectory, PERIOD))
    ctx.raise_if_cancelled()
    cell.arm.start(trajectory, replace=True)
    return cell.arm.setpoint().goal


def _approach(distance: float) -> float:
    if finite(distance, "z_approach") < 0:
        raise BadRequestError("range", f"z_approach must not be negative, got {distance}.")
    return distance


TOOLS = (go_to_pose_arm, go_to_pose_both, move_to_joints_both, apply_policy_action, execute_action_chunk)
