"""Free motions whose paths cuRobo finds on a GPU; goals, timing and the check afterwards stay the embedded ones.

The first call in a process builds and warms cuRobo up. Both raise as the embedded provider does, and `ToolError`
(`extra`, `setting`, `unsupported`, `too_large`, `package`).
"""

from __future__ import annotations

from gap_catalogue.curobo import GraspMotionPlan, MotionPlan, PlanToGraspPoses, PlanToPose
from gap_motion.curobo.search import search
from gap_motion.tools.plan import grasp_plan, pose_plan
from gap_runtime.contracts.tool import ToolContext, serves

DEADLINE_S = 300.0


@serves(PlanToGraspPoses, provider="hf", deadline_s=DEADLINE_S)
def plan_to_grasp_poses(ctx: ToolContext, request: PlanToGraspPoses) -> GraspMotionPlan:
    """The path is cuRobo's, all else the embedded provider's."""
    return grasp_plan(ctx, request, lambda scene: search)


@serves(PlanToPose, provider="hf", deadline_s=DEADLINE_S)
def plan_to_pose(ctx: ToolContext, request: PlanToPose) -> MotionPlan:
    """The path is cuRobo's, which always optimises it."""
    return pose_plan(ctx, request, lambda scene: search)


TOOLS = (plan_to_grasp_poses, plan_to_pose)
