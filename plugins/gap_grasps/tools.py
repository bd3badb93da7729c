"""The grasp-generation tools of the catalogue, served by antipodal sampling."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_grasps.clearance import Hand, above, clear_of
from gap_grasps.generate import Grasps, generate, prepare
from gap_grasps.scoring import score_poses
from gap_grasps.support import NEARBY, SUPPORT_MARGIN, others, plane_around, support_below, within
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import (
    CAMERA,
    WORLD,
    Array,
    DepthImage,
    Mask,
    Matrix3x3,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
)

DOWN = np.array([0.0, 0.0, -1.0])
FORWARD = np.array([0.0, 0.0, 1.0])  # along the view, in the camera frame


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

    Poses are T_world_tcp between the fingertips; a score is the chance of success when the hand misses its place by a
    few millimetres and degrees (see `pose_error`), whatever the arm's reach; of equals the more upright comes first.
    A `scene_cloud` is kept clear of; scores below `grasp_threshold` are dropped (-1 keeps all).
    Raises `PerceptionError` (`too_few_points`).
    """
    rng = np.random.default_rng([ctx.seed, len(target_cloud.points)])
    floor = support_below(ctx, target_cloud.points)
    surface = prepare(target_cloud.points, floor, rng, remove_outliers=remove_outliers)
    obstacles = None if scene_cloud is None else others(scene_cloud.points, target_cloud.points, floor)
    found = generate(
        surface, Hand.of(ctx.robot()), rng, count=num_grasps, preferred=DOWN, floor=floor, obstacles=obstacles
    )
    return WorldGrasps(*_listed(found, topk_num_grasps, grasp_threshold))


@tool("graspgen.ScoreGrasps", deadline_s=20.0)
def score_grasps(
    ctx: ToolContext, target_cloud: Annotated[PointCloud, WORLD], candidate_poses: list[Annotated[Se3Pose, WORLD]]
) -> Scores:
    """Score given grasps as the sampler scores its own: the chance of success when the hand misses its place a little.

    0 where the hand would overlap with the target or its support, or hold nothing. Raises `BadRequestError`
    (`not_finite`), `PerceptionError` (`too_few_points`).
    """
    T = np.array([p.matrix for p in candidate_poses]).reshape(-1, 4, 4)
    if not np.isfinite(T).all():
        which = int(np.argmin(np.isfinite(T).all(axis=(1, 2))))
        raise BadRequestError("not_finite", f"Candidate {which} has a position that is not finite.")
    rng = np.random.default_rng([ctx.seed, len(target_cloud.points)])
    floor, hand = support_below(ctx, target_cloud.points), Hand.of(ctx.robot())
    surface = prepare(target_cloud.points, floor, rng)
    fits = np.ones(len(T), dtype=bool) if floor is None else above(floor, T, hand)
    fits[fits] = clear_of(surface.points, T[fits], hand)
    scores = np.zeros(len(T))
    scores[fits] = score_poses(surface, T[fits], hand, floor)
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
    full, target = segment_clouds(depth, intrinsics, segmentation)
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
    floor = support_below(ctx, target)
    standing = target if floor is None else target[target[:, 2] > floor + SUPPORT_MARGIN]
    found = generate(
        prepare(standing, None if target_cloud is None else floor, rng),
        Hand.of(ctx.robot()),
        rng,
        count=max_grasps,
        preferred=DOWN,
        floor=floor,
        obstacles=others(points, standing, floor),
    )
    return WorldGrasps(*_listed(found, max_grasps, grasp_threshold))


def segment_clouds(depth: DepthImage, intrinsics: Matrix3x3, segmentation: Mask) -> tuple[Array, Array]:
    """The points (N, 3) of a depth image and (M, 3) of its masked part, in the camera frame.

    Raises `BadRequestError` (`shape`).
    """
    from gap_geometry.clouds import back_project

    if segmentation.data.shape != depth.data.shape:
        raise BadRequestError("shape", "The segmentation and the depth image differ in size.")
    valid = np.isfinite(depth.data) & (depth.data > 0)
    return back_project(depth, intrinsics, valid), back_project(depth, intrinsics, valid & segmentation.data)


def in_range(full: Array, target: Array, instance_id: int, z_range: tuple[float, float]) -> tuple[Array, Array]:
    """The points of both clouds whose depth is within `z_range` [m]. Raises `BadRequestError` (`instance_id`)."""
    if instance_id != 1:
        raise BadRequestError("instance_id", f"A mask holds one instance, 1; there is no instance {instance_id}.")
    low, high = z_range
    # A NaN or an infinity compares false somewhere, so what is not finite in depth goes too.
    near = [p[(p[:, 2] >= low) & (p[:, 2] <= high)] for p in (full, target)]
    return near[0], near[1]


def _in_camera(
    ctx: ToolContext, full: Array, target: Array, instance_id: int, z_range: tuple[float, float], max_retries: int
) -> CameraGrasps:
    full, target = in_range(full, target, instance_id, z_range)
    rng = np.random.default_rng([ctx.seed, len(target)])
    full = within(full, target, NEARBY) if len(target) else full
    T = plane_around(full, target, rng) if len(target) else None
    T_frame_camera, floor, preferred = (np.eye(4), None, FORWARD) if T is None else (T, 0.0, DOWN)
    full, target = (p @ T_frame_camera[:3, :3].T + T_frame_camera[:3, 3] for p in (full, target))
    surface, hand = prepare(target, floor, rng), Hand.of(ctx.robot())
    rest = others(full, target, floor)
    for _ in range(max(1, max_retries)):
        found = generate(surface, hand, rng, count=200, preferred=preferred, floor=floor, obstacles=rest)
        if len(found.scores):
            break
    back = np.linalg.inv(T_frame_camera)
    in_camera = Grasps(back @ found.poses, found.scores, found.contacts @ back[:3, :3].T + back[:3, 3])
    return CameraGrasps(*_listed(in_camera, 200, -1.0))


def _listed(found: Grasps, top: int, threshold: float) -> tuple[list[Se3Pose], list[float], list[Vec3]]:
    keep = np.nonzero(found.scores >= threshold)[0][:top]
    positions = found.poses[keep, :3, 3].tolist()
    # All at once: one rotation at a time costs as much as sampling does.
    quaternions = Rotation.from_matrix(found.poses[keep, :3, :3]).as_quat(canonical=True).tolist() if len(keep) else []
    return (
        [Se3Pose(Vec3(*p), Quaternion(w, x, y, z)) for p, (x, y, z, w) in zip(positions, quaternions, strict=True)],
        found.scores[keep].tolist(),
        [Vec3(*p) for p in found.contacts[keep].tolist()],
    )


TOOLS = (plan_from_point_cloud, score_grasps, plan_from_depth, plan_from_clouds, plan_in_scene)
