"""`graspgen.PlanFromPointCloud` served by a GraspGen inference server (Murali et al., 2025), over ZeroMQ."""

from __future__ import annotations

from gap_catalogue.grasps import GraspgenPlanFromPointCloud, WorldGrasps
from gap_runtime.contracts.tool import ToolContext, serves

DEADLINE_S = 90.0  # the server may try several times


@serves(GraspgenPlanFromPointCloud, provider="hf", deadline_s=DEADLINE_S)
def plan_from_point_cloud(ctx: ToolContext, request: GraspgenPlanFromPointCloud) -> WorldGrasps:
    """By the GraspGen server that `GAP_HF_GRASPGEN_URL` names; scores are its discriminator's confidence.

    The server knows the object only: poses whose open hand would meet `scene_cloud` are left out here. A contact point
    is the cloud's point nearest the closing line. The server samples without a seed, so two calls differ.
    Raises `ToolError` (`setting`, `extra`, `unreachable`, `timeout`, `server`, `answer`) as well.
    """
    from gap_hf.grasps.client import plan

    return plan(ctx.robot(), request)


TOOLS = (plan_from_point_cloud,)
