"""A top-down grasp whose jaws close across the target's shorter horizontal axis, slid along it away from a base."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import GraspError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3

EDGE = 0.004  # m between a pad and the target's end


class ShortAxisGrasp(NamedTuple):
    """Where to turn the wrist and where to close the jaws (both T_world_tcp), and the target's width there [m]."""

    hover_pose: Annotated[Se3Pose, WORLD]
    grasp_pose: Annotated[Se3Pose, WORLD]
    width: float


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    base_obb: Annotated[OrientedBoundingBox, WORLD] | None = None,
    approach_offset: float = 0.12,
    slide_fraction: float = 0.5,
    grasp_depth: float = 0.5,
    jaw_margin: float = 0.003,
    support_clearance: float = 0.004,
    palm_clearance: float = 0.006,
) -> ShortAxisGrasp:
    """Plan the grasp. Raises `GraspError` (`too_wide`) when the shorter axis does not fit the jaws."""
    spec = ctx.robot()
    middle = ctx.tool("geometry_svc.TopDownGraspFromOBB", obb=target_obb)
    width = target_obb.extent_along(middle.rotation.rotation.apply([0.0, 1.0, 0.0]))
    limit = spec.gripper.max_width - 2 * jaw_margin
    if width > limit:
        raise GraspError(
            "too_wide",
            f"The target is {1000 * width:.0f} mm wide across its shorter axis; the jaws take {1000 * limit:.0f} mm.",
            detail={"width": width, "limit": limit},
        )
    shift = 0.0 if base_obb is None else slide_fraction * free_end(spec, target_obb, middle, base_obb)
    at = middle.moved([shift, 0.0, 0.0]).position
    top, bottom = target_obb.center.z + target_obb.extent.z, target_obb.center.z - target_obb.extent.z
    z = max(
        top - grasp_depth * (top - bottom),
        bottom + spec.gripper.finger_size[2] + support_clearance,
        top - spec.gripper.finger_depth + palm_clearance,
    )
    grasp = Se3Pose(Vec3(at.x, at.y, z), middle.rotation)
    return ShortAxisGrasp(grasp.moved([0.0, 0.0, -approach_offset]), grasp, width)


def free_end(spec: RobotSpec, target: OrientedBoundingBox, middle: Se3Pose, base: OrientedBoundingBox) -> float:
    """Signed distance [m] along the pads from the middle to the last place, away from the base, for a whole pad."""
    along = middle.rotation.rotation.apply([1.0, 0.0, 0.0])
    reach = max(0.0, target.extent_along(along) / 2 - spec.gripper.finger_size[1] - EDGE)
    away = float((target.center.array - base.center.array) @ along)
    return float(np.copysign(reach, away)) if away else reach
