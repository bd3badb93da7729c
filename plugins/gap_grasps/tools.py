"""The grasp-generation tools of the catalogue, served by antipodal sampling."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_cli.contracts.failures import BadRequestError
from gap_cli.contracts.tool import ToolContext, tool
from gap_cli.contracts.types import (
    CAMERA,
    WORLD,
    Array,
    DepthImage,
    Mask,
    Matrix3x3,
    PointCloud,
    Se3Pose,
    Vec3,
)
from gap_grasps.generate import Grasps, generate, prepare
from gap_grasps.scoring import score_poses

DOWN = np.array([0.0, 0.0, -1.0])
FORWARD = np.array([0.0, 0.0, 1.0])  # along the view, in the camera frame
SUPPORT_MARGIN = 0.006  # m above a support below which scene points are the support's own


class WorldGrasps(NamedTuple):
    """T_world_tcp, scores in [0, 1] best first, and one contact point of each."""

    grasp_poses: list[Annotated[Se3Pose, WORLD]]
    scores: list[float]
    contact_points: list[Vec3]


class CameraGrasps(NamedTuple):
    """T_camera_tcp, scores in [0, 1] best first, and one contact point of each."""

    grasp_poses: list[Annotated[Se3Pose, CAMERA]]
    scores: list[float]
    contact_points: list[Vec3]


class Scores(NamedTuple):
    """One score in [0, 1] per candidate, in their order."""

    scores: list[float]


@tool("graspgen.PlanFromPointCloud", deadline_s=20.0)
def plan_from_point_cloud(
    ctx: ToolContext,
    target_cloud: Annotated[PointCloud, WORLD],
    scene_cloud: Annotated[PointCloud, WORLD] | None = None,
    num_grasps: int = 200,
    topk_num_grasps: int = 50,
    grasp_threshold: float = -1.0,
    remove_outliers: bool = True,
) -> WorldGrasps:
    """Sample 6-DoF grasps on an object's cloud and return the best `topk_num_grasps`.

    Poses are T_world_tcp between the fingertips. A `scene_cloud` is kept clear of; scores below `grasp_threshold` are
    dropped (-1 keeps all). Raises `PerceptionError` (`too_few_points`).
    """
    rng = np.random.default_rng([ctx.seed, len(target_cloud.points)])
    floor = _support_below(ctx, target_cloud.points)
    surface = prepare(target_cloud.points, floor, rng, remove_outliers=remove_outliers)
    obstacles = None if scene_cloud is None else _others(scene_cloud.points, target_cloud.points, floor)
    found = generate(
        surface, ctx.robot().gripper, rng, count=num_grasps, preferred=DOWN, floor=floor, obstacles=obstacles
    )
    return WorldGrasps(*_listed(found, topk_num_grasps, grasp_threshold))


@tool("graspgen.ScoreGrasps", deadline_s=20.0)
def score_grasps(
    ctx: ToolContext, target_cloud: Annotated[PointCloud, WORLD], candidate_poses: list[Annotated[Se3Pose, WORLD]]
) -> Scores:
    """Score given grasps with the measure the sampler ranks by, so that both can be compared."""
    rng = np.random.default_rng([ctx.seed, len(target_cloud.points)])
    surface = prepare(target_cloud.points, _support_below(ctx, target_cloud.points), rng)
    T = np.array([p.matrix for p in candidate_poses]).reshape(-1, 4, 4)
    scores = score_poses(surface, T, ctx.robot().gripper) * (0.5 + 0.5 * (T[:, :3, 2] @ DOWN))
    return Scores([float(s) for s in scores])


@tool("graspnet.PlanFromDepth", deadline_s=20.0)
def plan_from_depth(
    ctx: ToolContext,
    depth: DepthImage,
    intrinsics: Matrix3x3,
    segmentation: Mask,
    instance_id: int = 1,
    z_min: float = 0.2,
    z_max: float = 2.0,
    max_retries: int = 7,
) -> CameraGrasps:
    """Sample grasps on the masked part of a depth image, in the camera frame.

    Pixels nearer than `z_min` or farther than `z_max` [m] are left out; sampling is repeated up to `max_retries` times
    until something is found. `instance_id` must be 1: a `Mask` holds one instance.
    Raises `BadRequestError` (`shape`, `instance_id`), `PerceptionError` (`too_few_points`).
    """
    from gap_geometry.clouds import back_project

    if segmentation.data.shape != depth.data.shape:
        raise BadRequestError("shape", "The segmentation and the depth image differ in size.")
    valid = np.isfinite(depth.data) & (depth.data > 0)
    full = back_project(depth, intrinsics, valid)
    target = back_project(depth, intrinsics, valid & segmentation.data)
    return _in_camera(ctx, full, target, instance_id, (z_min, z_max), max_retries)


@tool("graspnet.PlanFromPointCloud", deadline_s=20.0)
def plan_from_clouds(
    ctx: ToolContext,
    full_cloud: Annotated[PointCloud, CAMERA],
    segment_cloud: Annotated[PointCloud, CAMERA],
    instance_id: int = 1,
    z_min: float = 0.2,
    z_max: float = 2.0,
    max_retries: int = 7,
) -> CameraGrasps:
    """Sample grasps on a segment's cloud, clear of the full cloud, both in the camera frame."""
    return _in_camera(ctx, full_cloud.points, segment_cloud.points, instance_id, (z_min, z_max), max_retries)


@tool("m2t2.PlanFromPointCloud", deadline_s=20.0)
def plan_in_scene(
    ctx: ToolContext,
    scene_cloud: Annotated[PointCloud, WORLD],
    target_cloud: Annotated[PointCloud, WORLD] | None = None,
    num_points: int = 16384,
    grasp_threshold: float = 0.035,
    max_grasps: int = 200,
) -> WorldGrasps:
    """Sample grasps on the target, or on everything that stands on a support when no target is given.

    At most `num_points` of the scene are used. Raises `PerceptionError` (`too_few_points`).
    """
    rng = np.random.default_rng([ctx.seed, len(scene_cloud.points)])
    points = scene_cloud.points[np.isfinite(scene_cloud.points).all(axis=1)]
    if len(points) > num_points:
        points = points[np.sort(rng.choice(len(points), num_points, replace=False))]
    target = points if target_cloud is None else target_cloud.points
    floor = _support_below(ctx, target)
    standing = target if floor is None else target[target[:, 2] > floor + SUPPORT_MARGIN]
    found = generate(
        prepare(standing, None if target_cloud is None else floor, rng),
        ctx.robot().gripper,
        rng,
        count=max_grasps,
        preferred=DOWN,
        floor=floor,
        obstacles=_others(points, standing, floor),
    )
    return WorldGrasps(*_listed(found, max_grasps, grasp_threshold))


def _in_camera(
    ctx: ToolContext, full: Array, target: Array, instance_id: int, z_range: tuple[float, float], max_retries: int
) -> CameraGrasps:
    if instance_id != 1:
        raise BadRequestError("instance_id", f"A mask holds one instance, 1; there is no instance {instance_id}.")
    near = [p[(p[:, 2] >= z_range[0]) & (p[:, 2] <= z_range[1])] for p in (full, target)]
    rng = np.random.default_rng([ctx.seed, len(target)])
    surface = prepare(near[1], None, rng)
    others = _others(near[0], near[1], None)
    for _ in range(max(1, max_retries)):
        found = generate(surface, ctx.robot().gripper, rng, count=200, preferred=FORWARD, floor=None, obstacles=others)
        if len(found.scores):
            break
    return CameraGrasps(*_listed(found, 200, -1.0))


def _listed(found: Grasps, top: int, threshold: float) -> tuple[list[Se3Pose], list[float], list[Vec3]]:
    keep = np.nonzero(found.scores >= threshold)[0][:top]
    return (
        [Se3Pose.of(found.poses[i]) for i in keep],
        [float(found.scores[i]) for i in keep],
        [Vec3.of(found.contacts[i]) for i in keep],
    )


def _support_below(ctx: ToolContext, points: Array) -> float | None:
    """Height of the highest known support under the middle of the points, or None."""
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return None
    middle, low = np.median(finite[:, :2], axis=0), float(finite[:, 2].min())
    heights = [
        s.z
        for s in ctx.task.environment.supports.values()
        if (np.abs(middle - s.center) <= s.half_size).all() and s.z <= low + 2 * SUPPORT_MARGIN
    ]
    return max(heights, default=None)


def _others(scene: Array, target: Array, floor: float | None) -> Array:
    """Scene points that are neither the target's nor the support's."""
    from scipy.spatial import cKDTree

    scene = scene[np.isfinite(scene).all(axis=1)]
    if floor is not None:
        scene = scene[scene[:, 2] > floor + SUPPORT_MARGIN]
    target = target[np.isfinite(target).all(axis=1)]
    if not len(scene) or not len(target):
        return scene
    distance, _ = cKDTree(target).query(scene, distance_upper_bound=SUPPORT_MARGIN)
    return np.asarray(scene[~np.isfinite(distance)])


TOOLS = (plan_from_point_cloud, score_grasps, plan_from_depth, plan_from_clouds, plan_in_scene)
