"""`m2t2.PlanFromPointCloud` served by M2T2 (Yuan et al., 2023) through its published package, on a GPU.

`GAP_HF_M2T2` names the checkpoint file (m2t2.pth), `GAP_HF_M2T2_CONFIG` the config.yaml it was trained with, by default
the one beside it. Its PointNet++ is a CUDA extension, so this provider needs a GPU.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from gap_catalogue.grasps import M2t2PlanFromPointCloud, WorldGrasps
from gap_catalogue.shared import research_packages as published
from gap_catalogue.shared.point_clouds import require_surface
from gap_hf.device import compute_device
from gap_hf.grasps.network_grasps import PANDA_DEPTH, listed, rigid_grasps, tcp
from gap_hf.loading import DEADLINE_S
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array

CHECKPOINT, CONFIG = "GAP_HF_M2T2", "GAP_HF_M2T2_CONFIG"
TITLE, REPOSITORY = "M2T2", "the repository NVlabs/M2T2"
MEAN, STD = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])  # of the colours it was trained on
NEAR = 0.01  # m from the target's cloud within which a contact is on the target


@serves(M2t2PlanFromPointCloud, provider="hf", deadline_s=DEADLINE_S)
def plan_in_scene(ctx: ToolContext, request: M2t2PlanFromPointCloud) -> WorldGrasps:
    """By M2T2; scores are its confidence in the contact.

    A grasp is the target's when its contact lies within 1 cm of the target's cloud. `num_points` of the scene are
    sampled by the episode's seed. Raises `ToolError` (`setting`, `weights`, `extra`, `package`, `answer`) as well.
    """
    scene = request.scene_cloud
    usable = np.isfinite(scene.points).all(axis=1)
    points = scene.points[usable]
    require_surface(points)
    colours = None if scene.colors is None else scene.colors[usable]
    model, settings = _model()
    with published.running(TITLE, ctx.seed):
        answer = model.infer(
            _batch(points, colours, request.num_points, ctx.seed), _thresholds(settings, request.grasp_threshold)
        )
        poses, scores, contacts = (
            _joined(answer[key], shape)
            for key, shape in (("grasps", (-1, 4, 4)), ("grasp_confidence", (-1,)), ("grasp_contacts", (-1, 3)))
        )
    T, values = rigid_grasps(TITLE, poses, scores)
    if len(contacts) != len(T):
        raise ToolError("answer", f"{TITLE} sent {len(contacts)} contacts for {len(T)} grasps.")
    order = np.argsort(-values, kind="stable")
    if request.target_cloud is not None:
        order = order[_on(contacts[order], request.target_cloud.points)]
    order = order[: request.max_grasps]
    return WorldGrasps(*listed((T @ tcp(PANDA_DEPTH))[order], values[order], contacts[order]))


def _batch(points: Array, colours: Array | None, count: int, seed: int) -> dict[str, Any]:
    """One scene as the network's loader makes it: points and centred points with colours, and no object in hand."""
    import torch

    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(points))
    chosen = np.resize(chosen, count)  # repeats them where there are too few
    shown = np.zeros((len(points), 3)) if colours is None else (colours / 255.0 - MEAN) / STD
    inputs = np.concatenate([points - points.mean(axis=0), shown], axis=1)[chosen]
    batch = {
        "inputs": inputs,
        "points": points[chosen],
        "object_inputs": rng.random((1024, 6)),
        "ee_pose": np.eye(4),
        "cam_pose": np.eye(4),
        "bottom_center": np.zeros(3),
    }
    device = compute_device().device
    tensors: dict[str, Any] = {
        k: torch.as_tensor(v, dtype=torch.float32, device=device)[None] for k, v in batch.items()
    }
    return tensors | {
        "task_is_pick": torch.tensor([True], device=device), "task_is_place": torch.tensor([False], device=device),
    }  # fmt: skip


def _thresholds(settings: Any, threshold: float) -> Any:
    """The evaluation part of its configuration, in the world frame, with our threshold for contacts."""
    settings = settings.copy()
    settings.mask_thresh, settings.world_coord = threshold, True
    return settings


def _joined(per_object: Any, shape: tuple[int, ...]) -> Array:
    """What the network says per object of the one scene, one after the other."""
    parts = [part.detach().float().cpu().numpy().reshape(shape) for part in per_object[0]]
    return np.concatenate(parts) if parts else np.zeros([0 if n == -1 else n for n in shape])


def _on(contacts: Array, target: Array) -> Array:
    from scipy.spatial import cKDTree

    target = target[np.isfinite(target).all(axis=1)]
    if not len(target) or not len(contacts):
        return np.zeros(len(contacts), dtype=bool)
    distance, _ = cKDTree(target).query(contacts, distance_upper_bound=NEAR)
    return np.asarray(np.isfinite(distance))


def _model() -> tuple[Any, Any]:
    weights, place = published.path(CHECKPOINT, TITLE, folder=False), compute_device()
    chosen = os.environ.get(CONFIG, "").strip()
    config = Path(chosen).expanduser() if chosen else weights.with_name("config.yaml")
    if not config.is_file():
        raise ToolError("setting", f"{CONFIG} must name the config.yaml of {weights}; {config} is not there.")
    key = ("m2t2", str(weights), str(config), str(place.device))
    found: tuple[Any, Any] = published.once(key, lambda: _load(weights, config, place.device))
    return found


def _load(weights: Path, config: Path, device: Any) -> tuple[Any, Any]:
    import torch

    networks = published.module("m2t2.m2t2", TITLE, REPOSITORY)
    configurations = published.module("omegaconf", TITLE, REPOSITORY)
    with published.running(TITLE, 0):
        settings = configurations.OmegaConf.load(config)
        model = networks.M2T2.from_config(settings.m2t2)
        model.load_state_dict(torch.load(weights, map_location="cpu", weights_only=True)["model"])
        return model.to(device).eval(), settings.eval


TOOLS = (plan_in_scene,)
