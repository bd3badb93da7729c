"""From depth images to points and between frames, and how many points it takes to say anything."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.types import Array, DepthImage, Matrix3x3, PointCloud, Se3Pose

SURFACE = 30  # points; fewer do not show a surface


def valid_depth(depth: DepthImage) -> Array:
    """Boolean image of the pixels that carry a distance."""
    return np.isfinite(depth.data) & (depth.data > 0)


def focal(intrinsics: Matrix3x3) -> tuple[float, float, float, float]:
    """(fx, fy, cx, cy) [px]. Raises `BadRequestError` unless both focal lengths are positive and all is finite."""
    K = intrinsics.data
    if not np.isfinite(K).all() or K[0, 0] <= 0 or K[1, 1] <= 0:
        raise BadRequestError("intrinsics", f"Camera intrinsics need positive finite focal lengths, got {K.tolist()}.")
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])


def back_project(depth: DepthImage, intrinsics: Matrix3x3, pixels: Array) -> Array:
    """Camera-frame points of the pixels where the boolean image `pixels` holds, row by row, shape (N, 3) [m]."""
    fx, fy, cx, cy = focal(intrinsics)
    v, u = np.nonzero(pixels)
    z = depth.data[v, u].astype(float)
    return np.column_stack([(u - cx) * z / fx, (v - cy) * z / fy, z])


def to_frame(points: Array, T_b_a: Se3Pose) -> Array:
    """Points given in frame a, expressed in frame b, shape (N, 3)."""
    return np.asarray(points @ T_b_a.rotation.rotation.as_matrix().T + T_b_a.position.array)


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


def require_surface(points: Array) -> None:
    """Raise `PerceptionError` (`too_few_points`) when usable points (N, 3) are too few to show a surface."""
    if len(points) < SURFACE:
        raise PerceptionError(
            "too_few_points", f"{len(points)} usable points do not show a surface to grasp; {SURFACE} are needed."
        )
