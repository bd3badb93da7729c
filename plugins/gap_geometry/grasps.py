"""Grasp poses computed from a box alone: T_world_tcp, z along the approach, y along the jaws' closing direction."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_geometry.checks import finite, unit
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, Array, OrientedBoundingBox, Quaternion, Se3Pose, Vec3


class Candidates(NamedTuple):
    """Grasps to choose from, best first."""

    poses: list[Annotated[Se3Pose, WORLD]]


class FrontGrasp(NamedTuple):
    """A horizontal grasp, where to come from, and the way a drawer or door would move when pulled."""

    grasp_pose: Annotated[Se3Pose, WORLD]
    pre_grasp_pose: Annotated[Se3Pose, WORLD]
    approach_direction: Vec3
    slide_axis: Vec3


def tcp_rotation(approach: Array, closing: Array) -> Quaternion:
    """Rotation of a TCP whose z is `approach` and whose y is `closing` (made orthogonal to it), both unit (3,)."""
    y = closing - (closing @ approach) * approach
    y /= np.linalg.norm(y)
    return Quaternion.of(Rotation.from_matrix(np.column_stack([np.cross(y, approach), y, approach])))


def horizontal_axes(obb: OrientedBoundingBox) -> tuple[Array, Array, Array]:
    """The box's two most horizontal axes as unit vectors, shorter one first, and the half-extents of all three."""
    axes = unit(obb.orientation, "the box's orientation").rotation.as_matrix()
    half = obb.extent.array
    upright = int(np.argmax(np.abs(axes[2])))
    first, second = sorted((i for i in range(3) if i != upright), key=lambda i: (half[i], i))
    return axes[:, first], axes[:, second], half


@tool("geometry_svc.TopDownGraspFromOBB")
def top_down_grasp_from_obb(
    obb: Annotated[OrientedBoundingBox, WORLD], z_offset: float = 0.0
) -> Annotated[Se3Pose, WORLD]:
    """A top-down grasp at the box's centre raised by `z_offset` [m], the jaws closing across its shorter side."""
    short, _, _ = horizontal_axes(obb)
    closing = np.array([short[0], short[1], 0.0])
    # Jaws are symmetric: of the two equal grasps take the one nearest to the paper's top-down (0, 1, 0, 0).
    closing *= 1.0 if (closing[1], closing[0]) < (0.0, 0.0) else -1.0
    position = obb.center.array + np.array([0.0, 0.0, finite(z_offset, "z_offset")])
    return Se3Pose(Vec3.of(position), tcp_rotation(np.array([0.0, 0.0, -1.0]), closing / np.linalg.norm(closing)))


@tool("geometry_svc.TopDownGraspCandidates")
def top_down_grasp_candidates(obb: Annotated[OrientedBoundingBox, WORLD], z_offset: float = 0.0) -> Candidates:
    """The top-down grasp across the shorter side and the one turned by 90 degrees, in that order."""
    primary: Se3Pose = top_down_grasp_from_obb.function(obb, z_offset)
    return Candidates([primary, Se3Pose(primary.position, _turned(primary.rotation))])


@tool("geometry_svc.SelectTopDownGrasp")
def select_top_down_grasp(
    grasp_poses: list[Annotated[Se3Pose, WORLD]], gripper_position: Vec3
) -> Annotated[Se3Pose, WORLD]:
    """The most top-down of the grasps (approach angles within a degree count as equal), then the nearest.

    Raises `BadRequestError` (`empty`) for an empty list.
    """
    if not grasp_poses:
        raise BadRequestError("empty", "There is no grasp to select from.")

    def key(pose: Se3Pose) -> tuple[int, float]:
        down = -float(unit(pose.rotation, "a grasp's rotation").rotation.apply([0, 0, 1])[2])
        angle = round(float(np.degrees(np.arccos(np.clip(down, -1, 1)))))
        return angle, float(np.linalg.norm(pose.position.array - gripper_position.array))

    return min(grasp_poses, key=key)


@tool("geometry_svc.FrontGraspFromOBB")
def front_grasp_from_obb(
    ctx: ToolContext,
    obb: Annotated[OrientedBoundingBox, WORLD],
    approach_offset: float = 0.08,
    approach_hint: Vec3 | None = None,
    z_offset: float = 0.0,
) -> FrontGrasp:
    """A horizontal grasp on a handle, and where to come from.

    The approach runs along the horizontal box axis nearest to `approach_hint`, from `approach_offset` [m] in front;
    the jaws close across the smaller of the two remaining sides. Without a hint the approach points from the arm's
    base to the box. `slide_axis` is the pull direction.
    """
    center = obb.center.array
    hint = approach_hint.array if approach_hint else center - ctx.cell.arms[0].base_pose.position.array
    hint = np.array([hint[0], hint[1], 0.0])
    if not np.isfinite(hint).all() or np.linalg.norm(hint) < 1e-9:
        raise BadRequestError("approach_hint", "approach_hint must have a horizontal part.")
    axes = unit(obb.orientation, "the box's orientation").rotation.as_matrix().T
    half = obb.extent.array
    level = np.linalg.norm(axes[:, :2], axis=1)
    facing = int(np.argmax(np.abs(axes @ hint) * (level > 0.5)))
    approach = axes[facing] * np.sign(axes[facing] @ hint)
    closing = axes[min((i for i in range(3) if i != facing), key=lambda i: half[i])]
    rotation = tcp_rotation(approach, closing)
    grasp = center + np.array([0.0, 0.0, finite(z_offset, "z_offset")])
    before = grasp - finite(approach_offset, "approach_offset") * approach
    return FrontGrasp(
        Se3Pose(Vec3.of(grasp), rotation), Se3Pose(Vec3.of(before), rotation), Vec3.of(approach), Vec3.of(-approach)
    )


@tool("geometry_svc.RotateQuatZ90")
def rotate_quat_z90(quat: Quaternion) -> Quaternion:
    """Rotate an orientation by 90 degrees about world z."""
    return _turned(quat)


def _turned(quaternion: Quaternion) -> Quaternion:
    quarter = Rotation.from_euler("z", 90, degrees=True)
    return Quaternion.of(quarter * unit(quaternion, "the quaternion").rotation)


TOOLS = (
    top_down_grasp_from_obb,
    top_down_grasp_candidates,
    select_top_down_grasp,
    front_grasp_from_obb,
    rotate_quat_z90,
)
