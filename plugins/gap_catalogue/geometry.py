"""Point clouds, boxes, grasp poses and collision worlds: `geometry_svc.*`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_catalogue.checks import check_finite
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import (
    CAMERA,
    WORLD,
    CameraObservation,
    DepthImage,
    JointState,
    Mask,
    Matrix3x3,
    ObjectMask,
    OrientedBoundingBox,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
    WorldConfig,
)


class GraspCandidates(NamedTuple):
    """Grasps to choose from, best first."""

    poses: list[Annotated[Se3Pose, WORLD]]


class FrontGrasp(NamedTuple):
    """A horizontal grasp, where to come from, and the way a drawer or door would move when pulled."""

    grasp_pose: Annotated[Se3Pose, WORLD]
    pre_grasp_pose: Annotated[Se3Pose, WORLD]
    approach_direction: Vec3
    slide_axis: Vec3


class GroundDistance(NamedTuple):
    """A distance in the ground plane [m]."""

    distance: float


class BuiltWorld(NamedTuple):
    """The collision world and the names of its obstacles, masks first."""

    config: WorldConfig
    mesh_names: list[str]


class DepthToPointCloud(ToolRequest[Annotated[PointCloud, CAMERA]], tool="geometry_svc.DepthToPointCloud"):
    """Back-project a depth image to a camera-frame point cloud; pixels without depth are left out."""

    depth: DepthImage
    intrinsics: Matrix3x3


class MaskToWorldPoints(ToolRequest[Annotated[PointCloud, WORLD]], tool="geometry_svc.MaskToWorldPoints"):
    """Back-project the pixels of a mask to world-frame points; `camera_pose` is T_world_camera (optical).

    Raises `BadRequestError` (`shape`) when mask and depth differ in size.
    """

    mask: Mask
    depth: DepthImage
    intrinsics: Matrix3x3
    camera_pose: Annotated[Se3Pose, WORLD]

    def __post_init__(self) -> None:
        if self.mask.data.shape != self.depth.data.shape:
            raise BadRequestError(
                "shape", f"The mask is {self.mask.data.shape}, the depth image {self.depth.data.shape} (rows, columns)."
            )


class PixelToWorldPoint(ToolRequest[Vec3], tool="geometry_svc.PixelToWorldPoint"):
    """Back-project one pixel to a world point.

    Raises `BadRequestError` (`outside`) for a pixel outside the image, `PerceptionError` (`no_depth`) where depth is
    unknown.
    """

    pixel_x: int
    pixel_y: int
    depth: DepthImage
    intrinsics: Matrix3x3
    camera_pose: Annotated[Se3Pose, WORLD]


class TransformPoints(ToolRequest[PointCloud], tool="geometry_svc.TransformPoints"):
    """Apply a rigid transform T_b_a to points given in frame a; colours stay with their points."""

    point_cloud: PointCloud
    transform: Se3Pose


class FilterNoise(ToolRequest[Annotated[PointCloud, WORLD]], tool="geometry_svc.FilterNoise"):
    """Drop the points DBSCAN calls noise and keep all clusters.

    Noise is what is not within `eps` [m] of a point with `min_samples` such neighbours, itself included
    (Ester et al. 1996).

    Raises `PerceptionError` (`empty_cloud`) when nothing is left.
    """

    point_cloud: Annotated[PointCloud, WORLD]
    eps: float = 0.005
    min_samples: int = 10

    def __post_init__(self) -> None:
        check_noise_filter(self.eps, self.min_samples)


class ComputeOBB(ToolRequest[Annotated[OrientedBoundingBox, WORLD]], tool="geometry_svc.ComputeOBB"):
    """Fit an upright oriented bounding box to world points: z up, minimum-area rectangle in the ground plane.

    Axes are canonical, so that equal boxes are equal values: x is the longer horizontal side when one is at least
    1.1 times the other, else the side nearer to world x; its yaw lies in (-90, 90] degrees.
    Raises `PerceptionError` (`empty_cloud`) for fewer than four finite points.
    """

    point_cloud: Annotated[PointCloud, WORLD]


class FilterAndComputeOBB(ToolRequest[Annotated[OrientedBoundingBox, WORLD]], tool="geometry_svc.FilterAndComputeOBB"):
    """FilterNoise, then ComputeOBB, in one call."""

    point_cloud: Annotated[PointCloud, WORLD]
    eps: float = 0.005
    min_samples: int = 10

    def __post_init__(self) -> None:
        check_noise_filter(self.eps, self.min_samples)


class TopDownGraspFromOBB(ToolRequest[Annotated[Se3Pose, WORLD]], tool="geometry_svc.TopDownGraspFromOBB"):
    """A top-down grasp at the box's centre raised by `z_offset` [m], the jaws closing across its shorter side."""

    obb: Annotated[OrientedBoundingBox, WORLD]
    z_offset: float = 0.0

    def __post_init__(self) -> None:
        check_finite(z_offset=self.z_offset)


class TopDownGraspCandidates(ToolRequest[GraspCandidates], tool="geometry_svc.TopDownGraspCandidates"):
    """The top-down grasp across the shorter side and the one turned by 90 degrees, in that order."""

    obb: Annotated[OrientedBoundingBox, WORLD]
    z_offset: float = 0.0

    def __post_init__(self) -> None:
        check_finite(z_offset=self.z_offset)


class SelectTopDownGrasp(ToolRequest[Annotated[Se3Pose, WORLD]], tool="geometry_svc.SelectTopDownGrasp"):
    """The most top-down of the grasps (approach angles within a degree count as equal), then the nearest.

    Raises `BadRequestError` (`empty`) for an empty list.
    """

    grasp_poses: list[Annotated[Se3Pose, WORLD]]
    gripper_position: Vec3

    def __post_init__(self) -> None:
        if not self.grasp_poses:
            raise BadRequestError("empty", "There is no grasp to select from.")


class FrontGraspFromOBB(ToolRequest[FrontGrasp], tool="geometry_svc.FrontGraspFromOBB"):
    """A horizontal grasp on a handle, and where to come from.

    The approach runs along the horizontal box axis nearest to `approach_hint`, from `approach_offset` [m] in front;
    the jaws close across the smaller of the two remaining sides. Without a hint the approach points from the arm's
    base to the box. `slide_axis` is the pull direction.
    """

    obb: Annotated[OrientedBoundingBox, WORLD]
    approach_offset: float = 0.08
    approach_hint: Vec3 | None = None
    z_offset: float = 0.0

    def __post_init__(self) -> None:
        check_finite(approach_offset=self.approach_offset, z_offset=self.z_offset)


class RotateQuatZ90(ToolRequest[Quaternion], tool="geometry_svc.RotateQuatZ90"):
    """Rotate an orientation by 90 degrees about world z."""

    quat: Quaternion


class ComputeDropPosition(ToolRequest[Vec3], tool="geometry_svc.ComputeDropPosition"):
    """Where the centre of a held object belongs so that its bottom is `clearance` [m] above the container's top.

    `object_z_extent` is the object's half-height, as in `OrientedBoundingBox.extent.z`.
    Raises `BadRequestError` when either is negative or not finite.
    """

    container_obb: Annotated[OrientedBoundingBox, WORLD]
    clearance: float = 0.05
    object_z_extent: float = 0.0

    def __post_init__(self) -> None:
        check_finite(clearance=self.clearance, object_z_extent=self.object_z_extent)
        if self.clearance < 0 or self.object_z_extent < 0:
            raise BadRequestError(
                "range", f"clearance {self.clearance} and object_z_extent {self.object_z_extent} must not be negative."
            )


class ComputeXYDistance(ToolRequest[GroundDistance], tool="geometry_svc.ComputeXYDistance"):
    """Distance [m] between two points in the ground plane."""

    point_a: Vec3
    point_b: Vec3


class BuildWorldConfig(ToolRequest[BuiltWorld], tool="geometry_svc.BuildWorldConfig", effect="sense", deadline_s=20.0):
    """Reconstruct a named collision world from camera observations.

    Points under a mask become the obstacle of that name; all others above a support are grouped where gaps exceed
    `mesh_alpha` [m] and named `obstacle_0`, ... by size; supports are boxes under their surface. Each keeps its points
    on a `voxel_size` [m] grid. With `robot_joint_state`, points on the robot itself, its jaws as they are now, are left
    out; with `target_obb`, points inside that box become the obstacle `target`.
    Raises `BadRequestError` for a camera index or mask size that does not fit, or sizes that are not positive.
    """

    cameras: list[CameraObservation]
    object_masks: list[ObjectMask]
    voxel_size: float = 0.005
    mesh_alpha: float = 0.03
    robot_joint_state: JointState | None = None
    target_obb: Annotated[OrientedBoundingBox, WORLD] | None = None

    def __post_init__(self) -> None:
        if self.voxel_size <= 0 or self.mesh_alpha <= 0:
            raise BadRequestError(
                "range", f"voxel_size and mesh_alpha must be positive, got {self.voxel_size} and {self.mesh_alpha}."
            )
        for item in self.object_masks:
            if not 0 <= item.camera_index < len(self.cameras):
                raise BadRequestError(
                    "camera_index", f"Mask {item.name!r} is of camera {item.camera_index} of {len(self.cameras)}."
                )
            if item.mask.data.shape != self.cameras[item.camera_index].depth.data.shape:
                raise BadRequestError("shape", f"Mask {item.name!r} and its camera's depth image differ in size.")


def check_noise_filter(eps: float, min_samples: int) -> None:
    """Raises `BadRequestError` (`range`) for parameters of DBSCAN that mean nothing."""
    if eps <= 0 or min_samples < 1:
        raise BadRequestError("range", f"eps must be positive and min_samples at least 1, got {eps} and {min_samples}.")
