"""What a task's object models look like: each rendered alone, from known views, with its mask. No scene, no poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from gap_mujoco.model.compiled import compile_model, new_root
from gap_mujoco.model.props import build_object
from gap_mujoco.rendering.camera import OPTICAL, Renderer, observe
from gap_runtime.contracts.task import ObjectModel
from gap_runtime.contracts.task.rendering import ObjectView
from gap_runtime.contracts.types import Array, Mask

_FOVY = 30.0
_LIGHTS = ((-1.0, 1.0, 2.0), (-1.0, -1.0, 2.0))
_ELSEWHERE = (0.0, 0.0, -100.0, 1.0, 0.0, 0.0, 0.0)  # beyond the far plane
_FILL = 0.7  # share of the picture's height the object's longest diagonal takes


def render_objects(
    objects: Mapping[str, ObjectModel],
    *,
    yaws_deg: Sequence[float],
    elevations_deg: Sequence[float],
    distance: float | None = None,
    resolution: tuple[int, int] = (160, 160),
) -> list[ObjectView]:
    """A `contracts.task.rendering.ObjectRenderer`, under the light of the simulated cells. Raises `GraphicsError`."""
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
) -> ObjectView:  # fmt: skip
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
    return ObjectView(name, yaw, elevation, distance, frame, Mask(frame.depth.data > 0))


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
