"""Where to let go of something, and how far apart two points are on the ground."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_geometry.checks import finite
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import tool
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Vec3


class GroundDistance(NamedTuple):
    """A distance in the ground plane [m]."""

    distance: float


@tool("geometry_svc.ComputeDropPosition")
def compute_drop_position(
    container_obb: Annotated[OrientedBoundingBox, WORLD], clearance: float = 0.05, object_z_extent: float = 0.0
) -> Vec3:
    """Where the centre of a held object belongs so that its bottom is `clearance` [m] above the container's top.

    `object_z_extent` is the object's half-height, as in `OrientedBoundingBox.extent.z`.
    Raises `BadRequestError` when either is negative or not finite.
    """
    if finite(clearance, "clearance") < 0 or finite(object_z_extent, "object_z_extent") < 0:
        raise BadRequestError(
            "range", f"clearance {clearance} and object_z_extent {object_z_extent} must not be negative."
        )
    top = float(container_obb.corners[:, 2].max())
    return Vec3(container_obb.center.x, container_obb.center.y, top + clearance + object_z_extent)


@tool("geometry_svc.ComputeXYDistance")
def compute_xy_distance(point_a: Vec3, point_b: Vec3) -> GroundDistance:
    """Distance [m] between two points in the ground plane."""
    return GroundDistance(float(np.hypot(point_a.x - point_b.x, point_a.y - point_b.y)))


TOOLS = (compute_drop_position, compute_xy_distance)
