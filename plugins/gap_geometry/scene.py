"""A named collision world from what the cameras see: every point belongs to some obstacle, none is dropped."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from gap_catalogue.geometry import BuildWorldConfig, BuiltWorld
from gap_catalogue.shared.point_clouds import focal, to_frame, valid_depth
from gap_catalogue.shared.robot_chain import sphere_centers
from gap_geometry.boxes import MIN_POINTS, box_around
from gap_geometry.clouds import cluster
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import (
    Array,
    CameraObservation,
    JointState,
    ObjectMask,
    Obstacle,
    OrientedBoundingBox,
    PointCloud,
    Quaternion,
    Vec3,
    WorldConfig,
)

SUPPORT_MARGIN = 0.006  # m above a known support below which a point is taken for the support itself (depth noise)
# m a robot's surface may lie outside its planning spheres (covers, cables) plus calibration error: unmasked, the
# arm's own skin would be an obstacle at its own height.
ROBOT_MARGIN = 0.02


@serves(BuildWorldConfig)
def build_world_config(ctx: ToolContext, request: BuildWorldConfig) -> BuiltWorld:
    named, rest = _split(ctx, request.cameras, request.object_masks)
    if request.robot_joint_state is not None:
        rest = rest[~on_robot(ctx, rest, request.robot_joint_state)]
    if request.target_obb is not None:
        inside = _inside(rest, request.target_obb, margin=request.voxel_size)
        named.setdefault("target", []).append(rest[inside])
        rest = rest[~inside]
    obstacles = [_obstacle(name, np.concatenate(parts), request.voxel_size) for name, parts in named.items()]
    obstacles += _groups(_voxels(rest, request.voxel_size), request.mesh_alpha)
    found = [o for o in obstacles if o is not None] + _supports(ctx)
    return BuiltWorld(WorldConfig(tuple(found)), [o.name for o in found])


def _split(
    ctx: ToolContext, cameras: list[CameraObservation], masks: list[ObjectMask]
) -> tuple[dict[str, list[Array]], Array]:
    """World points under each named mask, and all others above the supports, over all cameras."""
    named: dict[str, list[Array]] = {}
    rest: list[Array] = [np.zeros((0, 3))]
    for index, camera in enumerate(cameras):
        free, points = valid_depth(camera.depth), _world(camera)
        for item in (m for m in masks if m.camera_index == index):
            named.setdefault(item.name, []).append(points[item.mask.data & free])
            free &= ~item.mask.data
        rest.append(points[_above_supports(ctx, points, free)])
    return named, np.concatenate(rest)


def _world(camera: CameraObservation) -> Array:
    """World point of every pixel (H, W, 3) [m]: rays are sums of a row and a column, which spares a product each."""
    fx, fy, cx, cy = focal(camera.intrinsics)
    rows, columns = camera.depth.data.shape
    right, down = (np.arange(columns) - cx) / fx, (np.arange(rows) - cy)[:, None] / fy
    T = camera.pose.matrix
    depth = np.where(np.isfinite(camera.depth.data), camera.depth.data, 0.0).astype(float)
    out = np.empty((rows, columns, 3))
    for axis in range(3):
        out[..., axis] = depth * (T[axis, 0] * right + T[axis, 1] * down + T[axis, 2]) + T[axis, 3]
    return out


def _above_supports(ctx: ToolContext, points: Array, free: Array) -> Array:
    """Which of the `free` pixels (H, W) show something in the workspace that is not a support itself."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    keep = free.copy()
    for support in ctx.task.environment.supports.values():
        (at_x, at_y), (half_x, half_y) = support.center, support.half_size
        over = (np.abs(x - at_x) <= half_x) & (np.abs(y - at_y) <= half_y)
        keep &= ~(over & (z < support.z + SUPPORT_MARGIN))
    for value, low, high in zip((x, y, z), *ctx.task.environment.workspace, strict=True):
        keep &= (value >= low) & (value <= high)
    return keep


def on_robot(ctx: ToolContext, points: Array, joints: JointState) -> Array:
    """Which of the points (N, 3) [m] are on the first arm at `joints`, its jaws as wide as they are now; shape (N,)."""
    spec, arm = ctx.robot(), ctx.cell.arms[0]
    centers = to_frame(sphere_centers(spec, joints.positions, arm.state().gripper.width), arm.base_pose)
    radii = np.array([s.radius for s in spec.spheres])
    on = np.zeros(len(points), dtype=bool)
    if len(points):
        for near in cKDTree(points).query_ball_point(centers, radii + ROBOT_MARGIN):
            on[near] = True
    return on


def _inside(points: Array, box: OrientedBoundingBox, margin: float) -> Array:
    local = box.orientation.rotation.inv().apply(points - box.center.array) if len(points) else points
    return np.asarray((np.abs(local) <= box.extent.array + margin).all(axis=1))


def _voxels(points: Array, size: float) -> Array:
    """One point, the centre, per occupied voxel, in order of x, y, z."""
    cells = np.floor(points / size).astype(np.int64)
    if not len(cells):
        return points
    low = cells.min(axis=0)
    spans = cells.max(axis=0) - low + 1
    keys = np.unique(np.ravel_multi_index(tuple((cells - low).T), tuple(spans)))
    return np.asarray((np.column_stack(np.unravel_index(keys, tuple(spans))) + low + 0.5) * size)


def _groups(points: Array, gap: float) -> list[Obstacle | None]:
    """Clusters closed over gaps of up to `gap`; a lone point is an obstacle too."""
    if not len(points):
        return []
    labels = cluster(points, gap, 1)
    order = np.argsort(-np.bincount(labels), kind="stable")
    return [_obstacle(f"obstacle_{i}", points[labels == label], None) for i, label in enumerate(order)]


def _obstacle(name: str, points: Array, voxel_size: float | None) -> Obstacle | None:
    if voxel_size is not None:
        points = _voxels(points, voxel_size)
    if not len(points):
        return None
    # A rectangle needs four points: stand-ins at the corners of a hair's breadth keep a lone point an obstacle.
    padded = points if len(points) >= MIN_POINTS else np.concatenate([points + d for d in 1e-4 * np.eye(3)] + [points])
    return Obstacle(name, box_around(PointCloud(padded)), points)


def _supports(ctx: ToolContext) -> list[Obstacle]:
    depth = 0.05
    return [
        Obstacle(
            name,
            OrientedBoundingBox(
                Vec3(*s.center, s.z - depth), Vec3(*s.half_size, depth), Quaternion(1.0, 0.0, 0.0, 0.0)
            ),
        )
        for name, s in ctx.task.environment.supports.items()
    ]


TOOLS = (build_world_config,)
