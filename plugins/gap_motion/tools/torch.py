"""`pyroki.SolveIK` on pytorch-kinematics: another provider of the name, for whoever wants the library's own answer."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gap_motion.arguments import ArmModel, joints_of, pose_matrix
from gap_motion.failures import joint_range
from gap_motion.kinematics.damped_least_squares import descend
from gap_motion.tools.pyroki import Solution
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, JointState, Se3Pose, Vec3


@tool("pyroki.SolveIK", effect="sense", provider="pytorch-kinematics")
def solve_ik_torch(
    ctx: ToolContext,
    target_pose: Annotated[Se3Pose, WORLD],
    target_link_name: str = "",
    prev_config: JointState | None = None,
    tcp_offset: Vec3 | None = None,
) -> Solution:
    """The configuration of arm 0 nearest to `prev_config` that pytorch-kinematics finds, polished to full precision.

    Arguments as in the embedded provider. Raises `BadRequestError`, or `PlanningError` (`unreachable`).
    """
    from gap_motion.kinematics.ik_torch import solve_batch

    cell = ArmModel.of(ctx, 0)
    target = cell.last_frame(pose_matrix(target_pose, "target_pose"), tcp_offset, target_link_name)[None]
    seed = cell.joints() if prev_config is None else joints_of(prev_config, cell.spec, "prev_config")
    q = solve_batch(cell.chain, target, np.asarray(seed))
    if not np.isnan(q).any():
        q = descend(cell.chain, target, q, joint_range(cell.spec))
    if np.isnan(q).any():
        raise PlanningError("unreachable", "pytorch-kinematics found no configuration for target_pose.")
    return Solution(JointState(q[0]), True)


TOOLS = (solve_ik_torch,)
