"""`pyroki.SolveIK` on pytorch-kinematics: another provider of the name, for whoever wants the library's own answer."""

from __future__ import annotations

import numpy as np

from gap_catalogue.pyroki import NearestIkSolution, PyrokiSolveIK
from gap_catalogue.shared.robot_chain import joint_range
from gap_motion.arguments import ArmModel, joints_of, pose_matrix
from gap_motion.kinematics.damped_least_squares import damped_least_squares
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import JointState


@serves(PyrokiSolveIK, provider="pytorch-kinematics")
def solve_ik_torch(ctx: ToolContext, request: PyrokiSolveIK) -> NearestIkSolution:
    """The nearest configuration that pytorch-kinematics finds, polished to full precision."""
    from gap_motion.kinematics.ik_torch import solve_batch

    cell = ArmModel.of(ctx, 0)
    target = cell.last_joint_frame(
        pose_matrix(request.target_pose, "target_pose"), request.tcp_offset, request.target_link_name
    )[None]
    seed = cell.joints() if request.prev_config is None else joints_of(request.prev_config, cell.spec, "prev_config")
    q = solve_batch(cell.chain, target, np.asarray(seed))
    if not np.isnan(q).any():
        q = damped_least_squares(cell.chain, target, q, joint_range(cell.spec))
    if np.isnan(q).any():
        raise PlanningError("unreachable", "pytorch-kinematics found no configuration for target_pose.")
    return NearestIkSolution(JointState(q[0]), True)


TOOLS = (solve_ik_torch,)
