"""What a task's object models look like: each rendered alone, from known views, with its mask. No scene, no poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from gap_mujoco.model.compiled import compile_model, new_root
from gap_mujoco.model.props import build_object, cavity, collision_primitives
from gap_mujoco.rendering.camera import OPTICAL, Renderer, observe
from gap_runtime.contracts.task import ObjectModel
from gap_runtime.contracts.types import Array, CameraObservation, Mask

__all__ = ["ModelView", "build_object", "cavity", "collision_primitives", "render_views"]

_FOVY = 30.0
_LIGHTS = ((-1.0, 1.0, 2.0), (-1.0, -1.0, 2.0))
_ELSEWHERE = (0.0, 0.0, -100.0, 1.0, 0.0, 0.0, 0.0)  # beyond the far plane
_FILL = 0.7  # share of the picture's height the object's longest diagonal takes


@dataclass(frozen=True)
class ModelView:
    """One picture of one model, which stands at the world's origin turned by `yaw_deg` about z.

    The camera is `elevation_deg` above the horizon (90: straight down), on the -x side, at `distance` [m].
    """

    name: str
    yaw_deg: float
    elevation_deg: float
    distance: float
    observation: CameraObservation
    mask: Mask


def render_views(
    objects: Mapping[str, ObjectModel],
    *,
    yaws_deg: Sequence[float] = (0, 45, 90, 135, 180, 225, 270, 315),
    elevations_deg: Sequence[float] = (35, 60, 89.9),
    distance: float | None = None,
    resolution: tuple[int, int] = (160, 160),
) -> list[ModelView]:
    """Render each model alone under the world's own light, in a fixed order: by object, elevation, yaw.

    `distance` [m] is from camera to object centre; None fits each object to the picture. The background is black and
    at depth 0. Raises `GraphicsError`, `DocumentError`.
    """
    root = new_root("views", resolution, _LIGHTS)
    for name, model in objects.items():
        root.attach(build_object(name, model)).add("freejoint")
    root.worldbody.add("camera", name="camera", mode="fixed", fovy=_FOVY)
    compiled = compile_model(root)
    data, renderer = mujoco.MjData(compiled), Renderer(compiled, resolution)
    try:
        return [
            _view(renderer, compiled, data, name, yaw, elevation, distance or _fitting(model), resolution)
            for name, model in objects.items()
            for elevation in elevations_deg
            for yaw in yaws_deg
        ]
    finally:
        renderer.close()


def _view(
    renderer: Renderer, model: Any, data: Any, name: str, yaw: float, elevation: float, distance: float,
    resolution: tuple[int, int],
) -> ModelView:  # fmt: skip
    for joint in np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        start = model.jnt_qposadr[joint]
        data.qpos[start : start + 7] = _ELSEWHERE
    half = np.radians(yaw) / 2
    data.joint(f"{name}/").qpos[:] = (0, 0, 0, np.cos(half), 0, 0, np.sin(half))
    model.cam_pos[0], rotation = _look_at_origin(elevation, distance)
    mujoco.mju_mat2Quat(model.cam_quat[0], rotation.ravel())
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    frame = observe(renderer, data, "camera", resolution, _FOVY, f"{name}@{yaw:g},{elevation:g}")
    return ModelView(name, yaw, elevation, distance, frame, Mask(frame.depth.data > 0))


def _fitting(model: ObjectModel) -> float:
    return float(np.linalg.norm(model.shape.size) / 2 / np.tan(np.radians(_FOVY * _FILL) / 2))


def _look_at_origin(elevation_deg: float, distance: float) -> tuple[Array, Array]:
    """Position and rotation (MuJoCo camera axes) of a camera on the -x side looking at the origin, image top up."""
    e = np.radians(elevation_deg)
    position = distance * np.array([-np.cos(e), 0.0, np.sin(e)])
    forward = -position / distance
    right = np.array([0.0, -1.0, 0.0])
    down = np.cross(forward, right)
    return position, np.column_stack([right, down, forward]) @ OPTICAL
