"""Refusals shared by the geometry tools: what cannot be computed on is named before any arithmetic."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.types import Array, DepthImage, Matrix3x3, PointCloud, Quaternion


def finite_points(cloud: PointCloud, *, at_least: int = 1) -> Array:
    """The finite points of a cloud, shape (N, 3). Raises `PerceptionError` when fewer than `at_least` are left."""
    points = cloud.points[np.isfinite(cloud.points).all(axis=1)]
    if len(points) < at_least:
        raise PerceptionError(
            "empty_cloud",
            f"The point cloud has {len(points)} finite points; at least {at_least} are needed.",
            hint="Check the mask and the depth it was cut from.",
        )
    return points


def valid_depth(depth: DepthImage) -> Array:
    """Boolean image of the pixels that carry a distance."""
    return np.isfinite(depth.data) & (depth.data > 0)


def focal(intrinsics: Matrix3x3) -> tuple[float, float, float, float]:
    """(fx, fy, cx, cy) [px]. Raises `BadRequestError` unless both focal lengths are positive and all is finite."""
    K = intrinsics.data
    if not np.isfinite(K).all() or K[0, 0] <= 0 or K[1, 1] <= 0:
        raise BadRequestError("intrinsics", f"Camera intrinsics need positive finite focal lengths, got {K.tolist()}.")
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])


def unit(quaternion: Quaternion, what: str) -> Quaternion:
    """The quaternion itself. Raises `BadRequestError` unless its norm is 1 within 1e-3."""
    norm = float(np.linalg.norm([quaternion.w, quaternion.x, quaternion.y, quaternion.z]))
    if not abs(norm - 1) < 1e-3:
        raise BadRequestError("quaternion", f"{what} has norm {norm:.4g}; a rotation needs a unit quaternion (wxyz).")
    return quaternion


def finite(value: float, what: str) -> float:
    """The number itself. Raises `BadRequestError` when it is not finite."""
    if not np.isfinite(value):
        raise BadRequestError("not_finite", f"{what} is {value}; it must be a finite number.")
    return value
