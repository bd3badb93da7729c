"""`graspnet.*` served by Contact-GraspNet (Sundermeyer et al., 2021) through its PyTorch package.

The package (contact_graspnet_pytorch) and its checkpoint folder are published together; `GAP_HF_GRASPNET` names the
folder, with its config.yaml and checkpoints/model.pt. Poses come back as the gripper's base in the OpenCV camera frame.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np

from gap_grasps import tools as contracts
from gap_grasps.generate import enough
from gap_grasps.tools import CameraGrasps, in_range, segment_clouds
from gap_hf.device import placement
from gap_hf.grasps import research_packages as published
from gap_hf.grasps.gripper_frame import PANDA_DEPTH, rigid_grasps, tcp
from gap_hf.loading import DEADLINE_S
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import CAMERA, Array, DepthImage, Mask, Matrix3x3, PointCloud, Se3Pose, Vec3

CHECKPOINT = "GAP_HF_GRASPNET"
TITLE, PACKAGE = "Contact-GraspNet", "contact_graspnet_pytorch"
REPOSITORY = "the repository elchun/contact_graspnet_pytorch"


@serves(contracts.plan_from_depth, provider="hf", deadline_s=DEADLINE_S)
def plan_from_depth(
    ctx: ToolContext,
    depth: DepthImage,
    intrinsics: Matrix3x3,
    segmentation: Mask,
    instance_id: int = 1,
    z_min: float = 0.2,
    z_max: float = 2.0,
    max_retries: int = 7,
) -> CameraGrasps:
    """Ask Contact-GraspNet for grasps on the masked part of a depth image, best first, in the camera frame.

    Poses are T_camera_tcp, scores the network's confidence in the contact. Sampling of the cloud follows the episode's
    seed. Raises `BadRequestError` (`shape`, `instance_id`), `PerceptionError` (`too_few_points`), `ToolError`
    (`setting`, `weights`, `extra`, `package`, `answer`).
    """
    full, target = segment_clouds(depth, intrinsics, segmentation)
    return _plan(ctx, full, target, instance_id, (z_min, z_max), max_retries)


@serves(contracts.plan_from_clouds, provider="hf", deadline_s=DEADLINE_S)
def plan_from_clouds(
    ctx: ToolContext,
    full_cloud: Annotated[PointCloud, CAMERA],
    segment_cloud: Annotated[PointCloud, CAMERA],
    instance_id: int = 1,
    z_min: float = 0.2,
    z_max: float = 2.0,
    max_retries: int = 7,
) -> CameraGrasps:
    """Ask Contact-GraspNet for grasps on a segment of a scene's cloud, both in the camera frame; see PlanFromDepth."""
    return _plan(ctx, full_cloud.points, segment_cloud.points, instance_id, (z_min, z_max), max_retries)


def _plan(
    ctx: ToolContext, full: Array, target: Array, instance_id: int, z_range: tuple[float, float], max_retries: int
) -> CameraGrasps:
    full, target = (p[np.isfinite(p).all(axis=1)] for p in in_range(full, target, instance_id, z_range))
    enough(target)
    estimator = _estimator()
    for attempt in range(max(1, max_retries)):
        with published.running(TITLE, ctx.seed + attempt):
            poses, scores, contacts, _ = estimator.predict_scene_grasps(
                full.copy(), pc_segments={1: target.copy()}, local_regions=True, filter_grasps=True
            )
        if len(scores.get(1, ())):
            return _listed(poses[1], scores[1], contacts[1])
    return CameraGrasps([], [], [])


def _listed(poses: object, scores: object, contacts: object) -> CameraGrasps:
    T, values = rigid_grasps(TITLE, poses, scores)
    points = np.asarray(contacts, dtype=float).reshape(-1, 3)
    if len(points) != len(T):
        raise ToolError("answer", f"{TITLE} sent {len(points)} contacts for {len(T)} grasps.")
    T = T @ tcp(PANDA_DEPTH)
    order = np.argsort(-values, kind="stable")
    return CameraGrasps(
        [Se3Pose.of(T[i]) for i in order], [float(values[i]) for i in order], [Vec3.of(points[i]) for i in order]
    )


def _estimator() -> Any:
    folder, place = published.path(CHECKPOINT, TITLE, folder=True), placement()
    return published.once(("graspnet", str(folder), str(place.device)), lambda: _load(folder, place.device))


def _load(folder: Path, device: Any) -> Any:
    import torch

    weights = folder / "checkpoints" / "model.pt"
    if not weights.is_file():
        raise ToolError("weights", f"{CHECKPOINT} names {folder}, which holds no checkpoints/model.pt.")
    estimators = published.module(f"{PACKAGE}.contact_grasp_estimator", TITLE, REPOSITORY)
    config = published.module(f"{PACKAGE}.config_utils", TITLE, REPOSITORY)
    with published.running(TITLE, 0):
        estimator = estimators.GraspEstimator(config.load_config(str(folder), batch_size=1, arg_configs=[]))
        estimator.model.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True)["model"])
        estimator.model.to(device).eval()
        estimator.device = estimator.model.device = device  # it asks for a GPU by itself otherwise
    return estimator


TOOLS = (plan_from_depth, plan_from_clouds)
