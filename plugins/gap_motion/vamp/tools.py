"""Provider `vamp`: free motions whose paths VAMP finds; goals, timing and the check afterwards stay as they are.

All raise as the embedded provider does, and `ToolError` (`unsupported`) for an arm that VAMP has no model of.
"""

from __future__ import annotations

from gap_catalogue.curobo import GraspMotionPlan, MotionPlan, PlanToGraspPoses, PlanToPose, PlanWithGraspedObject
from gap_motion.tools.plan import grasp_plan, held_plan, pose_plan
from gap_motion.vamp.search import VampSearch
from gap_runtime.contracts.tool import ToolContext, serves


@serves(PlanToGraspPoses, provider="vamp")
def plan_to_grasp_poses(ctx: ToolContext, request: PlanToGraspPoses) -> GraspMotionPlan:
    """The path is VAMP's; goals, straight approach, timing and the check of it are the embedded provider's."""
    return grasp_plan(ctx, request, VampSearch.of)


@serves(PlanToPose, provider="vamp")
def plan_to_pose(ctx: ToolContext, request: PlanToPose) -> MotionPlan:
    """The path is VAMP's."""
    return pose_plan(ctx, request, lambda scene: VampSearch.of(scene, request.improve))


@serves(PlanWithGraspedObject, provider="vamp")
def plan_with_grasped_object(ctx: ToolContext, request: PlanWithGraspedObject) -> MotionPlan:
    """The path is VAMP's; what is held is spheres at VAMP's tip."""
    return held_plan(ctx, request, VampSearch.of)


TOOLS = (plan_to_grasp_poses, plan_to_pose, plan_with_grasped_object)
