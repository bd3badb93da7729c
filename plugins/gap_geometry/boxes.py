"""Gravity-aligned oriented bounding boxes with canonical axes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.geometry import ComputeOBB, FilterAndComputeOBB
from gap_catalogue.shared.point_clouds import finite_points
from gap_geometry.clouds import without_noise
from gap_runtime.contracts.tool import serves
from gap_runtime.contracts.types import Array, OrientedBoundingBox, PointCloud, Quaternion, Vec3

MIN_POINTS = 4  # fewer span no volume
ELONGATED = 1.1  # side ratio from which the longer side is the x axis; below, noise would flip it between frames


@serves(ComputeOBB)
def compute_obb(request: ComputeOBB) -> OrientedBoundingBox:
    return box_around(request.point_cloud)


@serves(FilterAndComputeOBB)
def filter_and_compute_obb(request: FilterAndComputeOBB) -> OrientedBoundingBox:
    return box_around(without_noise(request.point_cloud, request.eps, request.min_samples))


def box_around(cloud: PointCloud) -> OrientedBoundingBox:
    """The upright box of `geometry_svc.ComputeOBB`."""
    points = finite_points(cloud, at_least=MIN_POINTS)
    center, half, yaw = _rectangle(points[:, :2])
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    return OrientedBoundingBox(
        Vec3(float(center[0]), float(center[1]), (low + high) / 2),
        Vec3(float(half[0]), float(half[1]), (high - low) / 2),
        Quaternion.of(Rotation.from_euler("z", yaw)),
    )


def _rectangle(xy: Array) -> tuple[Array, Array, float]:
    """Minimum-area rectangle of points (N, 2): centre, half sides (x first), yaw of x [rad], canonical."""
    import cv2

    # float32 inside OpenCV: centre first, or coordinates of a metre lose tenths of a millimetre.
    origin = xy.mean(axis=0)
    (cx, cy), (width, height), degrees = cv2.minAreaRect((xy - origin).astype(np.float32))
    sides, yaw = np.array([width, height], dtype=float), np.radians(float(degrees))
    if _swap(sides, yaw):
        sides, yaw = sides[::-1], yaw + np.pi / 2
    yaw = np.pi / 2 - (np.pi / 2 - yaw) % np.pi  # to (-pi/2, pi/2]
    return origin + np.array([cx, cy]), sides / 2, float(yaw)


def _swap(sides: Array, yaw: float) -> bool:
    """True when the rectangle's second side is the canonical x axis."""
    long, short = sides.max(), sides.min()
    if long > ELONGATED * short:
        return bool(sides[1] > sides[0])
    return bool(abs(np.sin(yaw)) > abs(np.cos(yaw)))


TOOLS = (compute_obb, filter_and_compute_obb)
