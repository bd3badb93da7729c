"""`pyroki.*`: planner-free inverse kinematics and straight lines, on the CPU."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_motion.arguments import ArmModel, joints_of, pose_matrix, positive
from gap_motion.kinematics.ik import nearest
from gap_motion.planning import moves
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, JointState, Se3Pose, Trajectory, Vec3


class Solution(NamedTuple):
    """A configuration that puts the link where it was asked for."""

    joint_config: JointState
    success: bool


class Line(NamedTuple):
    """A timed straight-line motion."""

    trajectory: Trajectory
    success: bool


@tool("pyroki.SolveIK", effect="sense")
def solve_ik(
    ctx: ToolContext,
    target_pose: Annotated[Se3Pose, WORLD],
    target_link_name: str = "",
    prev_config: JointState | None = None,
    tcp_offset: Vec3 | None = None,
) -> Solution:
    """The configuration of arm 0 nearest to `prev_config` (default: where the arm is) for a TCP pose.

    `target_link_name` (default: the hand's flange) sits at `tcp_offset` [m] from the TCP, along the TCP's axes; by
    default the robot's own TCP is meant, and no offset for another link.
    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits` with joint and excess); `success` is true
    whenever it returns.
    """
    cell = ArmModel.of(ctx, 0)
    target = cell.last_frame(pose_matrix(target_pose, "target_pose"), tcp_offset, target_link_name)
    seed = cell.joints() if prev_config is None else joints_of(prev_config, cell.spec, "prev_config")
    return Solution(JointState(nearest(cell.chain, target, seed, "target_pose")), True)


@tool("pyroki.PlanLinear", effect="sense")
def plan_linear(
    ctx: ToolContext,
    start_pose: Annotated[Se3Pose, WORLD],
    end_pose: Annotated[Se3Pose, WORLD],
    num_waypoints: int = 20,
    dt: float = 0.02,
) -> Line:
    """A straight line of arm 0's TCP between two poses, as fast as the arm's limits allow, sampled every `dt` [s].

    It starts at the configuration for `start_pose` nearest to where the arm is; inverse kinematics is solved at
    `num_waypoints` poses at least, on one branch. Raises `BadRequestError`, or `PlanningError` (`unreachable`,
    `limits`, `no_path`, with the waypoint); `success` is true whenever it returns.
    """
    cell = ArmModel.of(ctx, 0)
    if not 2 <= num_waypoints <= 1000:
        raise BadRequestError("range", f"num_waypoints must be 2 to 1000, got {num_waypoints}.")
    first, last = (
        cell.last_frame(pose_matrix(pose, what)) for pose, what in ((start_pose, "start_pose"), (end_pose, "end_pose"))
    )
    start = nearest(cell.chain, first, cell.joints(), "start_pose")
    planned = moves.straight(cell, start, last, num_waypoints)
    return Line(moves.sampled(planned, positive(dt, "dt")), True)


TOOLS = (solve_ik, plan_linear)
