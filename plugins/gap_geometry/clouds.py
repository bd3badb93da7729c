"""Point clouds from depth, and their filtering and transformation."""

from __future__ import annotations

import numpy as np

from gap_catalogue.geometry import DepthToPointCloud, FilterNoise, MaskToWorldPoints, PixelToWorldPoint, TransformPoints
from gap_catalogue.shared.point_clouds import back_project, finite_points, to_frame, valid_depth
from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.tool import serves
from gap_runtime.contracts.types import Array, PointCloud, Vec3


@serves(DepthToPointCloud)
def depth_to_point_cloud(request: DepthToPointCloud) -> PointCloud:
    return PointCloud(back_project(request.depth, request.intrinsics, valid_depth(request.depth)))


@serves(MaskToWorldPoints)
def mask_to_world_points(request: MaskToWorldPoints) -> PointCloud:
    shown = request.mask.data & valid_depth(request.depth)
    return PointCloud(to_frame(back_project(request.depth, request.intrinsics, shown), request.camera_pose))


@serves(PixelToWorldPoint)
def pixel_to_world_point(request: PixelToWorldPoint) -> Vec3:
    x, y = request.pixel_x, request.pixel_y
    rows, columns = request.depth.data.shape
    if not (0 <= x < columns and 0 <= y < rows):
        raise BadRequestError("outside", f"Pixel ({x}, {y}) is outside the {columns}x{rows} image.")
    pixels = np.zeros((rows, columns), dtype=bool)
    pixels[y, x] = True
    if not (pixels & valid_depth(request.depth)).any():
        raise PerceptionError("no_depth", f"Pixel ({x}, {y}) has no depth.")
    return Vec3.of(to_frame(back_project(request.depth, request.intrinsics, pixels), request.camera_pose)[0])


@serves(TransformPoints)
def transform_points(request: TransformPoints) -> PointCloud:
    return PointCloud(to_frame(request.point_cloud.points, request.transform), request.point_cloud.colors)


@serves(FilterNoise)
def filter_noise(request: FilterNoise) -> PointCloud:
    return without_noise(request.point_cloud, request.eps, request.min_samples)


def without_noise(cloud: PointCloud, eps: float, min_samples: int) -> PointCloud:
    """The cloud without what `is_noise`. Raises `PerceptionError` (`empty_cloud`) when nothing is left."""
    points = finite_points(cloud)
    keep = ~is_noise(points, eps, min_samples)
    colors = cloud.colors
    if colors is not None:
        colors = colors[np.isfinite(cloud.points).all(axis=1)][keep]
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


TOOLS = (depth_to_point_cloud, mask_to_world_points, pixel_to_world_point, transform_points, filter_noise)
