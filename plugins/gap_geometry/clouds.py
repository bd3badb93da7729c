"""Point clouds from depth, and their filtering and transformation."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gap_geometry.checks import finite_points, focal, unit, valid_depth
from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.tool import tool
from gap_runtime.contracts.types import CAMERA, WORLD, Array, DepthImage, Mask, Matrix3x3, PointCloud, Se3Pose, Vec3


def back_project(depth: DepthImage, intrinsics: Matrix3x3, pixels: Array) -> Array:
    """Camera-frame points of the pixels where the boolean image `pixels` holds, row by row, shape (N, 3) [m]."""
    fx, fy, cx, cy = focal(intrinsics)
    v, u = np.nonzero(pixels)
    z = depth.data[v, u].astype(float)
    return np.column_stack([(u - cx) * z / fx, (v - cy) * z / fy, z])


def to_frame(points: Array, T_b_a: Se3Pose) -> Array:
    """Points given in frame a, expressed in frame b, shape (N, 3)."""
    rotation = unit(T_b_a.rotation, "the transform's rotation").rotation.as_matrix()
    return np.asarray(points @ rotation.T + T_b_a.position.array)


@tool("geometry_svc.DepthToPointCloud")
def depth_to_point_cloud(depth: DepthImage, intrinsics: Matrix3x3) -> Annotated[PointCloud, CAMERA]:
    """Back-project a depth image to a camera-frame point cloud; pixels without depth are left out."""
    return PointCloud(back_project(depth, intrinsics, valid_depth(depth)))


@tool("geometry_svc.MaskToWorldPoints")
def mask_to_world_points(
    mask: Mask, depth: DepthImage, intrinsics: Matrix3x3, camera_pose: Annotated[Se3Pose, WORLD]
) -> Annotated[PointCloud, WORLD]:
    """Back-project the pixels of a mask to world-frame points; `camera_pose` is T_world_camera (optical).

    Raises `BadRequestError` (`shape`) when mask and depth differ in size.
    """
    if mask.data.shape != depth.data.shape:
        raise BadRequestError(
            "shape", f"The mask is {mask.data.shape}, the depth image {depth.data.shape} (rows, columns)."
        )
    return PointCloud(to_frame(back_project(depth, intrinsics, mask.data & valid_depth(depth)), camera_pose))


@tool("geometry_svc.PixelToWorldPoint")
def pixel_to_world_point(
    pixel_x: int, pixel_y: int, depth: DepthImage, intrinsics: Matrix3x3, camera_pose: Annotated[Se3Pose, WORLD]
) -> Vec3:
    """Back-project one pixel to a world point.

    Raises `BadRequestError` (`outside`) for a pixel outside the image, `PerceptionError` (`no_depth`) where depth is
    unknown.
    """
    rows, columns = depth.data.shape
    if not (0 <= pixel_x < columns and 0 <= pixel_y < rows):
        raise BadRequestError("outside", f"Pixel ({pixel_x}, {pixel_y}) is outside the {columns}x{rows} image.")
    pixels = np.zeros((rows, columns), dtype=bool)
    pixels[pixel_y, pixel_x] = True
    if not (pixels & valid_depth(depth)).any():
        raise PerceptionError("no_depth", f"Pixel ({pixel_x}, {pixel_y}) has no depth.")
    return Vec3.of(to_frame(back_project(depth, intrinsics, pixels), camera_pose)[0])


@tool("geometry_svc.TransformPoints")
def transform_points(point_cloud: PointCloud, transform: Se3Pose) -> PointCloud:
    """Apply a rigid transform T_b_a to points given in frame a; colours stay with their points."""
    return PointCloud(to_frame(point_cloud.points, transform), point_cloud.colors)


@tool("geometry_svc.FilterNoise")
def filter_noise(
    point_cloud: Annotated[PointCloud, WORLD], eps: float = 0.005, min_samples: int = 10
) -> Annotated[PointCloud, WORLD]:
    """Drop the points DBSCAN calls noise and keep all clusters.

    Noise is what is not within `eps` [m] of a point with `min_samples` such neighbours, itself included
    (Ester et al. 1996).

    Raises `PerceptionError` (`empty_cloud`) when nothing is left.
    """
    points = finite_points(point_cloud)
    if eps <= 0 or min_samples < 1:
        raise BadRequestError("range", f"eps must be positive and min_samples at least 1, got {eps} and {min_samples}.")
    keep = ~is_noise(points, eps, min_samples)
    colors = point_cloud.colors
    if colors is not None:
        colors = colors[np.isfinite(point_cloud.points).all(axis=1)][keep]
    finite_points(PointCloud(points[keep]))
    return PointCloud(points[keep], colors)


def is_noise(points: Array, eps: float, min_samples: int) -> Array:
    """Which points DBSCAN would label -1, shape (N,): as `cluster` says, but for the last
    bit of a distance of exactly `eps`, several times as fast.

    Noise needs no clusters: a point is kept when its `min_samples`-th neighbour, or a point of which that is true,
    lies within `eps` [m].
    """
    from scipy.spatial import cKDTree

    if len(points) < min_samples:
        return np.ones(len(points), dtype=bool)
    bound = float(np.nextafter(eps, np.inf))  # scipy looks for what is nearer, DBSCAN for what is not farther
    reach, _ = cKDTree(points).query(points, k=[min_samples], distance_upper_bound=bound)
    core = reach[:, 0] <= eps
    if not core.any() or core.all():
        return np.asarray(~core)
    noise = ~core
    nearest, _ = cKDTree(points[core]).query(points[noise], distance_upper_bound=bound)
    noise[noise] = nearest > eps
    return np.asarray(noise)


def cluster(points: Array, eps: float, min_samples: int) -> Array:
    """DBSCAN label of each point, -1 for noise, shape (N,)."""
    from sklearn.cluster import DBSCAN

    return np.asarray(DBSCAN(eps=eps, min_samples=min_samples).fit_predict(points))


TOOLS = (
    depth_to_point_cloud,
    mask_to_world_points,
    pixel_to_world_point,
    transform_points,
    filter_noise,
)
