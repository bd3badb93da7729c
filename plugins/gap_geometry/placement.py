"""Where to let go of something, and how far apart two points are on the ground."""

from __future__ import annotations

import numpy as np

from gap_catalogue.geometry import ComputeDropPosition, ComputeXYDistance, GroundDistance
from gap_runtime.contracts.tool import serves
from gap_runtime.contracts.types import Vec3


@serves(ComputeDropPosition)
def compute_drop_position(request: ComputeDropPosition) -> Vec3:
    box = request.container_obb
    top = float(box.corners[:, 2].max())
    return Vec3(box.center.x, box.center.y, top + request.clearance + request.object_z_extent)


@serves(ComputeXYDistance)
def compute_xy_distance(request: ComputeXYDistance) -> GroundDistance:
    a, b = request.point_a, request.point_b
    return GroundDistance(float(np.hypot(a.x - b.x, a.y - b.y)))


TOOLS = (compute_drop_position, compute_xy_distance)
