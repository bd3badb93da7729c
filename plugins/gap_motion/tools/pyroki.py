"""`pyroki.*`: planner-free inverse kinematics and straight lines, on the CPU."""

from __future__ import annotations

from gap_catalogue.pyroki import NearestIkSolution, PyrokiPlanLinear, PyrokiSolveIK, TcpLine
from gap_motion.arguments import ArmModel, joints_of, pose_matrix, positive
from gap_motion.kinematics.ik import nearest
from gap_motion.planning import moves
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import JointState


@serves(PyrokiSolveIK)
def solve_ik(ctx: ToolContext, request: PyrokiSolveIK) -> NearestIkSolution:
    cell = ArmModel.of(ctx, 0)
    target = cell.last_joint_frame(
        pose_matrix(request.target_pose, "target_pose"), request.tcp_offset, request.target_link_name
    )
    seed = cell.joints() if request.prev_config is None else joints_of(request.prev_config, cell.spec, "prev_config")
    return NearestIkSolution(JointState(nearest(cell.chain, target, seed, "target_pose")), True)


@serves(PyrokiPlanLinear)
def plan_linear(ctx: ToolContext, request: PyrokiPlanLinear) -> TcpLine:
    cell = ArmModel.of(ctx, 0)
    if not 2 <= request.num_waypoints <= 1000:
        raise BadRequestError("range", f"num_waypoints must be 2 to 1000, got {request.num_waypoints}.")
    first, last = (
        cell.last_joint_frame(pose_matrix(pose, what))
        for pose, what in ((request.start_pose, "start_pose"), (request.end_pose, "end_pose"))
    )
    start = nearest(cell.chain, first, cell.joints(), "start_pose")
    planned = moves.cartesian_line(cell, start, last, request.num_waypoints)
    return TcpLine(moves.sampled(planned, positive(request.dt, "dt")), True)


TOOLS = (solve_ik, plan_linear)
