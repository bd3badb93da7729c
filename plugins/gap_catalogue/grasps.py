"""Grasp generation on point clouds and depth images: `graspgen.*`, `graspnet.*`, `m2t2.*`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_catalogue.checks import check_counts
from gap_catalogue.shared.point_clouds import back_project, valid_depth
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import CAMERA, WORLD, Array, DepthImage, Mask, Matrix3x3, PointCloud, Se3Pose, Vec3


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


class GraspScores(NamedTuple):
    """One score in [0, 1] per candidate, in their order."""

    scores: list[float]


class GraspgenPlanFromPointCloud(ToolRequest[WorldGrasps], tool="graspgen.PlanFromPointCloud", deadline_s=20.0):
    """Plan 6-DoF grasps on an object's cloud: the best `topk_num_grasps` of `num_grasps`, whatever the arm's reach.

    Poses are T_world_tcp between the fingertips. A `scene_cloud` is kept clear of; scores below `grasp_threshold` are
    dropped (-1 keeps all). Raises `BadRequestError` (`range`), `PerceptionError` (`too_few_points`).
    """

    target_cloud: Annotated[PointCloud, WORLD]
    scene_cloud: Annotated[PointCloud, WORLD] | None = None
    num_grasps: int = 200
    topk_num_grasps: int = 50
    grasp_threshold: float = -1.0
    remove_outliers: bool = True

    def __post_init__(self) -> None:
        check_counts(num_grasps=self.num_grasps, topk_num_grasps=self.topk_num_grasps)


class ScoreGrasps(ToolRequest[GraspScores], tool="graspgen.ScoreGrasps", deadline_s=20.0):
    """Score given grasps as PlanFromPointCloud scores its own; 0 where the hand overlaps something or holds nothing.

    Raises `BadRequestError` (`not_finite`), `PerceptionError` (`too_few_points`).
    """

    target_cloud: Annotated[PointCloud, WORLD]
    candidate_poses: list[Annotated[Se3Pose, WORLD]]


class PlanFromDepth(ToolRequest[CameraGrasps], tool="graspnet.PlanFromDepth", deadline_s=20.0):
    """Plan grasps on the masked part of a depth image, best first, in the camera frame.

    Pixels nearer than `z_min` or farther than `z_max` [m] are left out; planning is repeated up to `max_retries` times
    until something is found. `instance_id` must be 1: a `Mask` holds one instance.
    Raises `BadRequestError` (`shape`, `instance_id`), `PerceptionError` (`too_few_points`).
    """

    depth: DepthImage
    intrinsics: Matrix3x3
    segmentation: Mask
    instance_id: int = 1
    z_min: float = 0.2
    z_max: float = 2.0
    max_retries: int = 7

    def clouds(self) -> tuple[Array, Array]:
        """The points in range of the whole image (N, 3) and of its masked part (M, 3), in the camera frame [m]."""
        if self.segmentation.data.shape != self.depth.data.shape:
            raise BadRequestError("shape", "The segmentation and the depth image differ in size.")
        valid = valid_depth(self.depth)
        masks = (valid, valid & self.segmentation.data)
        full, segment = (back_project(self.depth, self.intrinsics, mask) for mask in masks)
        return _in_range(full, segment, self.instance_id, self.z_min, self.z_max)


class GraspnetPlanFromPointCloud(ToolRequest[CameraGrasps], tool="graspnet.PlanFromPointCloud", deadline_s=20.0):
    """Plan grasps on a segment's cloud, clear of the full cloud, both in the camera frame; see PlanFromDepth."""

    full_cloud: Annotated[PointCloud, CAMERA]
    segment_cloud: Annotated[PointCloud, CAMERA]
    instance_id: int = 1
    z_min: float = 0.2
    z_max: float = 2.0
    max_retries: int = 7

    def clouds(self) -> tuple[Array, Array]:
        """The points in range of both clouds, (N, 3) and (M, 3)."""
        full, segment = self.full_cloud.points, self.segment_cloud.points
        return _in_range(full, segment, self.instance_id, self.z_min, self.z_max)


class M2t2PlanFromPointCloud(ToolRequest[WorldGrasps], tool="m2t2.PlanFromPointCloud", deadline_s=20.0):
    """Plan grasps on the target, or on everything that stands on a support when no target is given, best first.

    At most `num_points` of the scene are used; scores below `grasp_threshold` are dropped.
    Raises `BadRequestError` (`range`), `PerceptionError` (`too_few_points`).
    """

    scene_cloud: Annotated[PointCloud, WORLD]
    target_cloud: Annotated[PointCloud, WORLD] | None = None
    num_points: int = 16384
    grasp_threshold: float = 0.035
    max_grasps: int = 200

    def __post_init__(self) -> None:
        check_counts(num_points=self.num_points, max_grasps=self.max_grasps)


def _in_range(full: Array, segment: Array, instance_id: int, z_min: float, z_max: float) -> tuple[Array, Array]:
    if instance_id != 1:
        raise BadRequestError("instance_id", f"A mask holds one instance, 1; there is no instance {instance_id}.")
    # A NaN or an infinity compares false somewhere, so what is not finite in depth goes too.
    near = [p[(p[:, 2] >= z_min) & (p[:, 2] <= z_max)] for p in (full, segment)]
    return np.asarray(near[0]), np.asarray(near[1])
