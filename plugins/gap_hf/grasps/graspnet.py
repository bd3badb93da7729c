"""`graspnet.*` served by Contact-GraspNet (Sundermeyer et al., 2021) through its PyTorch package.

The package (contact_graspnet_pytorch) and its checkpoint folder are published together; `GAP_HF_GRASPNET` names the
folder, with its config.yaml and checkpoints/model.pt. Poses come back as the gripper's base in the OpenCV camera frame.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gap_catalogue.grasps import CameraGrasps, GraspnetPlanFromPointCloud, PlanFromDepth
from gap_catalogue.shared import research_packages as published
from gap_catalogue.shared.point_clouds import require_surface
from gap_hf.device import compute_device
from gap_hf.grasps.network_grasps import PANDA_DEPTH, listed, rigid_grasps, tcp
from gap_hf.loading import DEADLINE_S
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.tool import ToolContext, serves

CHECKPOINT = "GAP_HF_GRASPNET"
TITLE, PACKAGE = "Contact-GraspNet", "contact_graspnet_pytorch"
REPOSITORY = "the repository elchun/contact_graspnet_pytorch"


@serves(PlanFromDepth, provider="hf", deadline_s=DEADLINE_S)
def plan_from_depth(ctx: ToolContext, request: PlanFromDepth) -> CameraGrasps:
    """By Contact-GraspNet; scores are its confidence in the contact. The cloud is sampled by the episode's seed.

    Raises `ToolError` (`setting`, `weights`, `extra`, `package`, `answer`) as well.
    """
    return _plan(ctx, request)


@serves(GraspnetPlanFromPointCloud, provider="hf", deadline_s=DEADLINE_S)
def plan_from_clouds(ctx: ToolContext, request: GraspnetPlanFromPointCloud) -> CameraGrasps:
    """By Contact-GraspNet; see PlanFromDepth."""
    return _plan(ctx, request)


def _plan(ctx: ToolContext, request: PlanFromDepth | GraspnetPlanFromPointCloud) -> CameraGrasps:
    full, target = (p[np.isfinite(p).all(axis=1)] for p in request.clouds())
    require_surface(target)
    estimator = _estimator()
    for attempt in range(max(1, request.max_retries)):
        with published.running(TITLE, ctx.seed + attempt):
            poses, scores, contacts, _ = estimator.predict_scene_grasps(
                full.copy(), pc_segments={1: target.copy()}, local_regions=True, filter_grasps=True
            )
        if len(scores.get(1, ())):
            return _ranked(poses[1], scores[1], contacts[1])
    return CameraGrasps([], [], [])


def _ranked(poses: object, scores: object, contacts: object) -> CameraGrasps:
    T, values = rigid_grasps(TITLE, poses, scores)
    points = np.asarray(contacts, dtype=float).reshape(-1, 3)
    if len(points) != len(T):
        raise ToolError("answer", f"{TITLE} sent {len(points)} contacts for {len(T)} grasps.")
    order = np.argsort(-values, kind="stable")
    return CameraGrasps(*listed((T @ tcp(PANDA_DEPTH))[order], values[order], points[order]))


def _estimator() -> Any:
    folder, place = published.path(CHECKPOINT, TITLE, folder=True), compute_device()
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
