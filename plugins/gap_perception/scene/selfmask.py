"""Which points are the robot itself: forward kinematics of its own model, from its own joint sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import RobotPlacement
from gap_runtime.contracts.types import ArmState, Array

MARGIN = 0.015  # m: the shells of a robot stick out of the simple shapes of its model by about a centimetre


class LinkShape(NamedTuple):
    """A simple shape of a link: MuJoCo geom type, half sizes [m], T_world_geom as rotation (3, 3) and position (3,)."""

    kind: int
    size: Array
    rotation: Array
    position: Array


def on_robot(points: Array, shapes: Sequence[LinkShape], margin: float = MARGIN) -> Array:
    """True for world points (N, 3) within `margin` of a shape."""
    hit = np.zeros(len(points), dtype=bool)
    centres = np.array([shape.position for shape in shapes]).reshape(-1, 3)
    reaches = np.array([float(np.linalg.norm(shape.size)) + margin for shape in shapes])
    # Most of what cameras see is nowhere near the robot: its own box leaves that out at once.
    low = (centres - reaches[:, None]).min(axis=0, initial=np.inf)
    high = (centres + reaches[:, None]).max(axis=0, initial=-np.inf)
    around = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
    for shape, centre, reach in zip(shapes, centres, reaches, strict=True):
        offset = points[around] - centre
        near = np.einsum("ni,ni->n", offset, offset) < reach**2
        local = offset[near] @ shape.rotation
        hit[around[near]] |= _distance(local, shape) < margin
    return hit


def link_shapes(model: Any, spec: RobotSpec, state: ArmState, placement: RobotPlacement) -> list[LinkShape]:
    """The robot's shapes where its joint sensors say they are; `model` is its own compiled MJCF."""
    import mujoco

    data = mujoco.MjData(model)
    fingers = [state.gripper.width / len(spec.gripper.joints)] * len(spec.gripper.joints)
    for name, value in zip((*spec.joints, *spec.gripper.joints), (*state.joints.positions, *fingers), strict=True):
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(model, data)
    base = Rotation.from_euler("z", placement.yaw_deg, degrees=True).as_matrix()
    return [
        LinkShape(
            int(model.geom_type[g]),
            _size(model, g),
            base @ data.geom_xmat[g].reshape(3, 3),
            base @ data.geom_xpos[g] + placement.position,
        )
        for g in range(model.ngeom)
    ]


def robot_model(spec: RobotSpec) -> Callable[[], Any]:
    """How to compile the robot's model, for `ToolContext.shared`."""

    def make() -> Any:
        import mujoco

        return mujoco.MjModel.from_xml_path(str(spec.model_file))

    return make


def _size(model: Any, geom: int) -> Array:
    """Half sizes; a capsule's are (radius, radius, half length of its axis plus radius)."""
    import mujoco

    kind, size = model.geom_type[geom], np.array(model.geom_size[geom], dtype=float)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.array([size[0], size[0], size[1] + size[0]])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return np.array([size[0], size[0], size[1]])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.full(3, size[0])
    return size if kind == mujoco.mjtGeom.mjGEOM_BOX else np.array(model.geom_aabb[geom, 3:], dtype=float)


def _distance(local: Array, shape: LinkShape) -> Array:
    """Distance outside a shape of points in its frame (N, 3), negative or 0 inside [m]."""
    import mujoco

    if shape.kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE):
        radius = shape.size[0]
        axis = np.clip(local[:, 2], -(shape.size[2] - radius), shape.size[2] - radius)
        return np.asarray(np.linalg.norm(local - np.outer(axis, [0, 0, 1]), axis=1) - radius)
    if shape.kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        outside = np.column_stack(
            [np.hypot(local[:, 0], local[:, 1]) - shape.size[0], np.abs(local[:, 2]) - shape.size[2]]
        )
    else:
        outside = np.abs(local) - shape.size
    return np.asarray(np.linalg.norm(np.maximum(outside, 0.0), axis=1))
