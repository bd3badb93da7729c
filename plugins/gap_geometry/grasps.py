"""Grasp poses computed from a box alone: T_world_tcp, z along the approach, y along the jaws' closing direction."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.geometry import (
    FrontGrasp,
    FrontGraspFromOBB,
    GraspCandidates,
    RotateQuatZ90,
    SelectTopDownGrasp,
    TopDownGraspCandidates,
    TopDownGraspFromOBB,
)
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, OrientedBoundingBox, Quaternion, Se3Pose, Vec3


def tcp_rotation(approach: Array, closing: Array) -> Quaternion:
    """Rotation of a TCP whose z is `approach` and whose y is `closing` (made orthogonal to it), both unit (3,)."""
    y = closing - (closing @ approach) * approach
    y /= np.linalg.norm(y)
    return Quaternion.of(Rotation.from_matrix(np.column_stack([np.cross(y, approach), y, approach])))


def horizontal_axes(obb: OrientedBoundingBox) -> tuple[Array, Array, Array]:
    """The box's two most horizontal axes as unit vectors, shorter one first, and the half-extents of all three."""
    axes = obb.orientation.rotation.as_matrix()
    half = obb.extent.array
    upright = int(np.argmax(np.abs(axes[2])))
    first, second = sorted((i for i in range(3) if i != upright), key=lambda i: (half[i], i))
    return axes[:, first], axes[:, second], half


@serves(TopDownGraspFromOBB)
def top_down_grasp_from_obb(request: TopDownGraspFromOBB) -> Se3Pose:
    return _top_down(request.obb, request.z_offset)


@serves(TopDownGraspCandidates)
def top_down_grasp_candidates(request: TopDownGraspCandidates) -> GraspCandidates:
    primary = _top_down(request.obb, request.z_offset)
    return GraspCandidates([primary, Se3Pose(primary.position, _turned(primary.rotation))])


def _top_down(obb: OrientedBoundingBox, z_offset: float) -> Se3Pose:
    short, _, _ = horizontal_axes(obb)
    closing = np.array([short[0], short[1], 0.0])
    # Jaws are symmetric: of the two equal grasps take the one nearest to the paper's top-down (0, 1, 0, 0).
    closing *= 1.0 if (closing[1], closing[0]) < (0.0, 0.0) else -1.0
    position = obb.center.array + np.array([0.0, 0.0, z_offset])
    return Se3Pose(Vec3.of(position), tcp_rotation(np.array([0.0, 0.0, -1.0]), closing / np.linalg.norm(closing)))


@serves(SelectTopDownGrasp)
def select_top_down_grasp(request: SelectTopDownGrasp) -> Se3Pose:
    def key(pose: Se3Pose) -> tuple[int, float]:
        down = -float(pose.rotation.rotation.apply([0, 0, 1])[2])
        angle = round(float(np.degrees(np.arccos(np.clip(down, -1, 1)))))
        return angle, float(np.linalg.norm(pose.position.array - request.gripper_position.array))

    return min(request.grasp_poses, key=key)


@serves(FrontGraspFromOBB)
def front_grasp_from_obb(ctx: ToolContext, request: FrontGraspFromOBB) -> FrontGrasp:
    center = request.obb.center.array
    hint = request.approach_hint.array if request.approach_hint else center - ctx.cell.arms[0].base_pose.position.array
    hint = np.array([hint[0], hint[1], 0.0])
    if not np.isfinite(hint).all() or np.linalg.norm(hint) < 1e-9:
        raise BadRequestError("approach_hint", "approach_hint must have a horizontal part.")
    axes = request.obb.orientation.rotation.as_matrix().T
    half = request.obb.extent.array
    level = np.linalg.norm(axes[:, :2], axis=1)
    facing = int(np.argmax(np.abs(axes @ hint) * (level > 0.5)))
    approach = axes[facing] * np.sign(axes[facing] @ hint)
    closing = axes[min((i for i in range(3) if i != facing), key=lambda i: half[i])]
    rotation = tcp_rotation(approach, closing)
    grasp = center + np.array([0.0, 0.0, request.z_offset])
    before = grasp - request.approach_offset * approach
    return FrontGrasp(
        Se3Pose(Vec3.of(grasp), rotation), Se3Pose(Vec3.of(before), rotation), Vec3.of(approach), Vec3.of(-approach)
    )


@serves(RotateQuatZ90)
def rotate_quat_z90(request: RotateQuatZ90) -> Quaternion:
    return _turned(request.quat)


def _turned(quaternion: Quaternion) -> Quaternion:
    quarter = Rotation.from_euler("z", 90, degrees=True)
    return Quaternion.of(quarter * quaternion.rotation)


TOOLS = (
    top_down_grasp_from_obb,
    top_down_grasp_candidates,
    select_top_down_grasp,
    front_grasp_from_obb,
    rotate_quat_z90,
)
