"""`robot_control.*` for one arm: every motion is planned, timed and checked whole before the arm is asked to move."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_motion.arguments import ArmModel, arm_of, finite, joints_of, pose_matrix, positive, trajectory_of
from gap_motion.planning import moves
from gap_motion.planning.multi_arm import move_together, refuse_meeting_others
from gap_motion.ready import at_rest
from gap_motion.timing.limits import refuse
from gap_motion.timing.timing import point_to_point
from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, Array, JointState, Se3Pose, Trajectory, Vec3

ARM = ("arm:0", "clock")


class Pose(NamedTuple):
    """A pose of the TCP."""

    pose: Annotated[Se3Pose, WORLD]


@tool("robot_control.GetEEPose", effect="sense")
def get_ee_pose(ctx: ToolContext, arm_id: int = 0) -> Pose:
    """T_world_tcp of one arm now, from its joint sensors."""
    return Pose(arm_of(ctx, arm_id).state().ee_pose)


@tool("robot_control.GoToPose", effect="actuate", resources=ARM, deadline_s=60.0)
def go_to_pose(
    ctx: ToolContext,
    pose: Annotated[Se3Pose, WORLD],
    z_approach: float = 0.0,
    tcp_offset: Vec3 | None = None,
    tolerance: float = 0.01,
    max_steps: int = 120,
    nonblocking: bool = False,
) -> None:
    """Move the TCP to a pose by joint motion to the nearest IK solution, with no collision avoidance.

    With `z_approach` [m] it first goes to the pose backed off by that much along the TCP's approach axis, then straight
    in. `tcp_offset` [m] is the flange seen from the TCP, along the TCP's axes; by default the robot's own TCP is meant.
    Done when every joint is within `tolerance` [rad]. One of `max_steps` is 50 ms of planned motion.

    With `nonblocking` it returns when the arm begins to move, and lets go of the arm. The arm then moves whenever world
    time passes: while the jaws open or close, while another arm moves, while something waits. Time does not pass while
    a policy computes or looks, so that is all it gains. The arm's next motion command first lets this one end; if it
    failed, the arm's next command raises that failure instead of beginning.
    Raises `BadRequestError`, `PlanningError` (`unreachable`, `limits`, `no_path`, `budget`), `MotionError`.
    """
    cell = ArmModel.of(ctx, 0)
    if finite(z_approach, "z_approach") < 0:
        raise BadRequestError("range", f"z_approach must not be negative, got {z_approach}.")
    target = cell.last_frame(pose_matrix(pose, "pose"), tcp_offset)
    near = positive(tolerance, "tolerance")
    start = at_rest(cell)
    trajectory = moves.within_steps(moves.to_pose(cell, start, target, z_approach), max_steps)
    _run(ctx, cell, trajectory, start, near, nonblocking)


@tool("robot_control.GoToPoseCartesian", effect="actuate", resources=ARM, deadline_s=60.0)
def go_to_pose_cartesian(
    ctx: ToolContext,
    pose: Annotated[Se3Pose, WORLD],
    lin_vel_norm: float = 1.0,
    ang_vel_norm: float = 2.0,
    timeout_s: float = 20,
) -> None:
    """Move the TCP along a straight line to a pose, turning at a constant axis, with no collision avoidance.

    `lin_vel_norm` [m/s] and `ang_vel_norm` [rad/s] bound the TCP's speed; the joints' own limits may make it slower.
    Refused before it starts when it would take longer than `timeout_s` [s].
    Raises `BadRequestError`, `PlanningError` (`unreachable`, `limits`, `no_path`, `budget`), `MotionError`.
    """
    cell = ArmModel.of(ctx, 0)
    speed, turning = positive(lin_vel_norm, "lin_vel_norm"), positive(ang_vel_norm, "ang_vel_norm")
    longest, target = positive(timeout_s, "timeout_s"), cell.last_frame(pose_matrix(pose, "pose"))
    start = at_rest(cell)
    trajectory = moves.straight(cell, start, target, speed=speed, turning=turning)
    if trajectory.duration > longest:
        raise PlanningError("budget", f"The line takes {trajectory.duration:.2f} s, more than timeout_s = {timeout_s}.")
    _run(ctx, cell, trajectory, start)


@tool("robot_control.ExecuteJointTrajectory", effect="actuate", resources=ARM, deadline_s=120.0)
def execute_joint_trajectory(
    ctx: ToolContext, trajectory: Trajectory, subsample: int = 1, tolerance: float = 0.01
) -> None:
    """Track a planned joint trajectory that starts where the arm is; done within `tolerance` [rad] of its end.

    Of its points only every `subsample`-th is kept, and the last. Raises `BadRequestError`, `MotionError` (`refused`
    when it leaves a limit or the workspace; nothing has moved then).
    """
    cell = ArmModel.of(ctx, 0)
    if subsample < 1:
        raise BadRequestError("range", f"subsample must be at least 1, got {subsample}.")
    planned = trajectory_of(trajectory, cell.spec)
    keep = np.unique(np.append(np.arange(0, len(planned.times), subsample), len(planned.times) - 1))
    velocities = None if planned.velocities is None else planned.velocities[keep]
    near = positive(tolerance, "tolerance")
    start = at_rest(cell)
    _run(ctx, cell, Trajectory(planned.times[keep], planned.positions[keep], velocities), start, near)


@tool("robot_control.MoveToJoints", effect="actuate", resources=ARM, deadline_s=60.0)
def move_to_joints(ctx: ToolContext, joint_config: JointState, tolerance: float = 0.01, max_steps: int = 120) -> None:
    """Move straight in joint space to a configuration, as fast as the limits allow, with no collision avoidance.

    One of `max_steps` is 50 ms of planned motion. Raises `BadRequestError`, `PlanningError` (`budget`), `MotionError`.
    """
    cell = ArmModel.of(ctx, 0)
    goal = joints_of(joint_config, cell.spec, "joint_config")
    near = positive(tolerance, "tolerance")
    start = at_rest(cell)
    planned = moves.within_steps(point_to_point(cell.chain, np.stack([start, goal])), max_steps)
    _run(ctx, cell, planned, start, near)


@tool("robot_control.GoHome", effect="actuate", resources=("arm:0", "arm:1", "clock"), deadline_s=60.0)
def go_home(ctx: ToolContext) -> None:
    """Move straight in joint space to the home configuration, the task's or else the robot's own; two arms together.

    Raises `MotionError`.
    """
    cells = [ArmModel.of(ctx, arm_id) for arm_id in range(len(ctx.cell.arms))]
    homes = [np.array(ctx.task.robots[cell.arm_id].home or cell.spec.home) for cell in cells]
    planned = [
        point_to_point(cell.chain, np.stack([at_rest(cell), home])) for cell, home in zip(cells, homes, strict=True)
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
    refuse(cell, planned, ctx.task, start)
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
