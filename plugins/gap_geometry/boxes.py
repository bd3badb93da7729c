"""Gravity-aligned oriented bounding boxes with canonical axes."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from scipy.spatial.transform import Rotation

from gap_geometry.checks import finite_points
from gap_geometry.clouds import filter_noise
from gap_runtime.contracts.tool import tool
from gap_runtime.contracts.types import WORLD, Array, OrientedBoundingBox, PointCloud, Quaternion, Vec3

MIN_POINTS = 4  # fewer span no volume
ELONGATED = 1.1  # side ratio from which the longer side is the x axis; below, noise would flip it between frames


@tool("geometry_svc.ComputeOBB")
def compute_obb(point_cloud: Annotated[PointCloud, WORLD]) -> Annotated[OrientedBoundingBox, WORLD]:
    """Fit an upright oriented bounding box to world points: z up, minimum-area rectangle in the ground plane.

    Axes are canonical, so that equal boxes are equal values: x is the longer horizontal side when one is at least
    `ELONGATED` times the other, else the side nearer to world x; its yaw lies in (-90, 90] degrees.
    Raises `PerceptionError` (`empty_cloud`) for fewer than four finite points.
    """
    points = finite_points(point_cloud, at_least=MIN_POINTS)
    center, half, yaw = _rectangle(points[:, :2])
    low, high = float(points[:, 2].min()), float(points[:, 2].max())
    return OrientedBoundingBox(
        Vec3(float(center[0]), float(center[1]), (low + high) / 2),
        Vec3(float(half[0]), float(half[1]), (high - low) / 2),
        Quaternion.of(Rotation.from_euler("z", yaw)),
    )


@tool("geometry_svc.FilterAndComputeOBB")
def filter_and_compute_obb(
    point_cloud: Annotated[PointCloud, WORLD], eps: float = 0.005, min_samples: int = 10
) -> Annotated[OrientedBoundingBox, WORLD]:
    """FilterNoise, then ComputeOBB, in one call."""
    cloud = filter_noise.function(point_cloud, eps, min_samples)
    return compute_obb.function(cloud)  # type: ignore[no-any-return]


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
