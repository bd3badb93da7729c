"""Grasps from above all over a box: both closing directions, every place of its footprint, several depths."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3

CLEARANCE = 0.004  # m between fingertips and support


class Swept(NamedTuple):
    """Grasps to be judged, T_world_tcp."""

    poses: list[Annotated[Se3Pose, WORLD]]


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    sweep_step: float = 0.012,
    sweep_depths: int = 3,
) -> Swept:
    """All poses of the sweep, no deeper than fingertips and palm allow."""
    heights = depths(ctx.robot(), target_obb, sweep_depths)
    poses = []
    for pose in ctx.tool("geometry_svc.TopDownGraspCandidates", obb=target_obb).poses:
        R = pose.rotation.rotation.as_matrix()
        half = np.abs(R.T @ target_obb.orientation.rotation.as_matrix()) @ target_obb.extent.array
        for x in places(float(half[0]), sweep_step):
            for y in places(float(half[1]), sweep_step):
                at = pose.position.array + R @ np.array([x, y, 0.0])
                poses += [Se3Pose(Vec3(float(at[0]), float(at[1]), z), pose.rotation) for z in heights]
    return Swept(poses)


def depths(spec: RobotSpec, obb: OrientedBoundingBox, count: int) -> list[float]:
    """TCP heights [m] from just below the top to as deep as the hand may go."""
    corners = obb.corners[:, 2]
    top, bottom = float(corners.max()), float(corners.min())
    tip = spec.gripper.finger_size[2]
    lowest = max(bottom + tip + CLEARANCE, top - spec.gripper.finger_depth + CLEARANCE)
    highest = max(lowest, top - tip)
    return [float(z) for z in np.unique(np.linspace(lowest, highest, count))]


def places(half: float, step: float) -> np.ndarray:
    """Offsets [m] from the middle, it among them, to the edges."""
    count = int(half / step)
    return step * np.arange(-count, count + 1)
