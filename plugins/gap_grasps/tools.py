"""The grasp-generation tools of the catalogue, served by antipodal sampling."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.grasps import (
    CameraGrasps,
    GraspgenPlanFromPointCloud,
    GraspnetPlanFromPointCloud,
    GraspScores,
    M2t2PlanFromPointCloud,
    PlanFromDepth,
    ScoreGrasps,
    WorldGrasps,
)
from gap_catalogue.shared.hand import Hand, above, clear_of
from gap_grasps.generate import Grasps, generate, prepare
from gap_grasps.scoring import score_poses
from gap_grasps.support import NEARBY, SUPPORT_MARGIN, crop_around, obstacle_points, plane_around, support_below
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, Quaternion, Se3Pose, Vec3

DOWN = np.array([0.0, 0.0, -1.0])
FORWARD = np.array([0.0, 0.0, 1.0])  # along the view, in the camera frame


@serves(GraspgenPlanFromPointCloud)
def plan_from_point_cloud(ctx: ToolContext, request: GraspgenPlanFromPointCloud) -> WorldGrasps:
    """By sampling. A score is the chance of success when the hand misses its place by a few millimetres and degrees.

    See `pose_error`. Of equals the more upright comes first.
    """
    target, scene = request.target_cloud.points, request.scene_cloud
    rng = np.random.default_rng([ctx.seed, len(target)])
    floor = support_below(ctx, target)
    surface = prepare(target, floor, rng, remove_outliers=request.remove_outliers)
    obstacles = None if scene is None else obstacle_points(scene.points, target, floor)
    found = generate(
        surface, Hand.of(ctx.robot()), rng, count=request.num_grasps, preferred=DOWN, floor=floor, obstacles=obstacles
    )
    return WorldGrasps(*_listed(found, request.topk_num_grasps, request.grasp_threshold))


@serves(ScoreGrasps)
def score_grasps(ctx: ToolContext, request: ScoreGrasps) -> GraspScores:
    """The chance of success when the hand misses its place a little."""
    T = np.array([p.matrix for p in request.candidate_poses]).reshape(-1, 4, 4)
    if not np.isfinite(T).all():
        which = int(np.argmin(np.isfinite(T).all(axis=(1, 2))))
        raise BadRequestError("not_finite", f"Candidate {which} has a position that is not finite.")
    target = request.target_cloud.points
    rng = np.random.default_rng([ctx.seed, len(target)])
    floor, hand = support_below(ctx, target), Hand.of(ctx.robot())
    surface = prepare(target, floor, rng)
    fits = np.ones(len(T), dtype=bool) if floor is None else above(floor, T, hand)
    fits[fits] = clear_of(surface.points, T[fits], hand)
    scores = np.zeros(len(T))
    scores[fits] = score_poses(surface, T[fits], hand, floor)
    return GraspScores([float(s) for s in scores])


@serves(PlanFromDepth)
def plan_from_depth(ctx: ToolContext, request: PlanFromDepth) -> CameraGrasps:
    return _in_camera(ctx, *request.clouds(), request.max_retries)


@serves(GraspnetPlanFromPointCloud)
def plan_from_clouds(ctx: ToolContext, request: GraspnetPlanFromPointCloud) -> CameraGrasps:
    return _in_camera(ctx, *request.clouds(), request.max_retries)


@serves(M2t2PlanFromPointCloud)
def plan_in_scene(ctx: ToolContext, request: M2t2PlanFromPointCloud) -> WorldGrasps:
    scene = request.scene_cloud.points
    rng = np.random.default_rng([ctx.seed, len(scene)])
    points = scene[np.isfinite(scene).all(axis=1)]
    if len(points) > request.num_points:
        points = points[np.sort(rng.choice(len(points), request.num_points, replace=False))]
    target = points if request.target_cloud is None else request.target_cloud.points
    floor = support_below(ctx, target)
    standing = target if floor is None else target[target[:, 2] > floor + SUPPORT_MARGIN]
    found = generate(
        prepare(standing, None if request.target_cloud is None else floor, rng),
        Hand.of(ctx.robot()),
        rng,
        count=request.max_grasps,
        preferred=DOWN,
        floor=floor,
        obstacles=obstacle_points(points, standing, floor),
    )
    return WorldGrasps(*_listed(found, request.max_grasps, request.grasp_threshold))


def _in_camera(ctx: ToolContext, full: Array, target: Array, max_retries: int) -> CameraGrasps:
    rng = np.random.default_rng([ctx.seed, len(target)])
    full = crop_around(full, target, NEARBY) if len(target) else full
    T = plane_around(full, target, rng) if len(target) else None
    T_frame_camera, floor, preferred = (np.eye(4), None, FORWARD) if T is None else (T, 0.0, DOWN)
    full, target = (p @ T_frame_camera[:3, :3].T + T_frame_camera[:3, 3] for p in (full, target))
    surface, hand = prepare(target, floor, rng), Hand.of(ctx.robot())
    rest = obstacle_points(full, target, floor)
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
