"""`graspgen.PlanFromPointCloud` served by a GraspGen inference server (Murali et al., 2025), over ZeroMQ."""

from __future__ import annotations

from typing import Annotated

from gap_grasps import tools as contracts
from gap_grasps.tools import WorldGrasps
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import WORLD, PointCloud

DEADLINE_S = 90.0  # the server may try several times


@serves(contracts.plan_from_point_cloud, provider="hf", deadline_s=DEADLINE_S)
def plan_from_point_cloud(
    ctx: ToolContext,
    target_cloud: Annotated[PointCloud, WORLD],
    scene_cloud: Annotated[PointCloud, WORLD] | None = None,
    num_grasps: int = 200,
    topk_num_grasps: int = 50,
    grasp_threshold: float = -1.0,
    remove_outliers: bool = True,
) -> WorldGrasps:
    """Ask the GraspGen server that `GAP_HF_GRASPGEN_URL` names for 6-DoF grasps on an object's cloud, best first.

    Poses are T_world_tcp, scores the discriminator's confidence. The server knows the object only: poses whose open
    hand would meet `scene_cloud` are left out here. A contact point is the cloud's point nearest the closing line. The
    server samples without a seed, so two calls differ.
    Raises `BadRequestError` (`range`), `PerceptionError` (`too_few_points`), `ToolError` (`setting`, `extra`,
    `unreachable`, `timeout`, `server`, `answer`).
    """
    from gap_hf.grasps.client import plan

    return plan(
        ctx.robot(), target_cloud.points, None if scene_cloud is None else scene_cloud.points,
        num_grasps=num_grasps, top=topk_num_grasps, threshold=grasp_threshold, remove_outliers=remove_outliers,
    )  # fmt: skip


TOOLS = (plan_from_point_cloud,)
