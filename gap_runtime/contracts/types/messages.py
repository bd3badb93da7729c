"""The values that flow along edges: frozen dataclasses over numpy.

Units are metres, radians, seconds, newtons, kilograms. Quaternions are (w, x, y, z), unit norm. `T_a_b` maps
coordinates in frame b to frame a. The camera frame is the optical one: x right, y down, z forward (OpenCV).
Arrays are made read-only on construction, so a value handed to two parallel branches cannot be changed by one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from gap_runtime.contracts.types.geometry import (
    WORLD,
    BoundingBox2D,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
)
from gap_runtime.contracts.types.value import Array, Value, frozen


@dataclass(frozen=True, eq=False)
class Detection(Value):
    """One detected object: where, what, and how sure (0 to 1)."""

    box: BoundingBox2D
    label: str
    score: float


@dataclass(frozen=True, eq=False)
class Image(Value):
    """RGB image, `data` uint8 of shape (H, W, 3)."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", frozen(self.data, np.uint8, (None, None, 3), "Image.data"))


@dataclass(frozen=True, eq=False)
class DepthImage(Value):
    """Distance along the optical axis [m], `data` float32 of shape (H, W); 0 or NaN where unknown."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", frozen(self.data, np.float32, (None, None), "DepthImage.data"))


@dataclass(frozen=True, eq=False)
class Mask(Value):
    """Boolean image, `data` bool of shape (H, W)."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", frozen(self.data, np.bool_, (None, None), "Mask.data"))


@dataclass(frozen=True, eq=False)
class PointCloud(Value):
    """Points [m], `points` float64 of shape (N, 3); optional `colors` uint8 of shape (N, 3)."""

    points: Array
    colors: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points, np.float64, (None, 3), "PointCloud.points"))
        if self.colors is not None:
            object.__setattr__(self, "colors", frozen(self.colors, np.uint8, (None, 3), "PointCloud.colors"))


@dataclass(frozen=True, eq=False)
class Matrix3x3(Value):
    """A 3x3 matrix, such as camera intrinsics [px]."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", frozen(self.data, np.float64, (3, 3), "Matrix3x3.data"))


@dataclass(frozen=True, eq=False)
class CameraObservation(Value):
    """One calibrated RGB-D frame. `pose` is T_world_camera (optical); `stamp` is world time [s]."""

    name: str
    rgb: Image
    depth: DepthImage
    intrinsics: Matrix3x3
    pose: Annotated[Se3Pose, WORLD]
    stamp: float = 0.0


@dataclass(frozen=True, eq=False)
class JointState(Value):
    """Joint `positions` [rad], shape (n,); optional `velocities` [rad/s] and `efforts` [Nm], shape (n,)."""

    positions: Array
    velocities: Array | None = None
    efforts: Array | None = None

    def __post_init__(self) -> None:
        for name in ("positions", "velocities", "efforts"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen(getattr(self, name), np.float64, (None,), f"JointState.{name}"))


@dataclass(frozen=True, eq=False)
class Trajectory(Value):
    """Joint motion: `times` [s] shape (T,) from 0, `positions` [rad] and `velocities` [rad/s] shape (T, n)."""

    times: Array
    positions: Array
    velocities: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", frozen(self.times, np.float64, (None,), "Trajectory.times"))
        shape = (len(self.times), None)
        object.__setattr__(self, "positions", frozen(self.positions, np.float64, shape, "Trajectory.positions"))
        if self.velocities is not None:
            object.__setattr__(self, "velocities", frozen(self.velocities, np.float64, shape, "Trajectory.velocities"))

    @property
    def duration(self) -> float:
        """Length in time [s]."""
        return float(self.times[-1] - self.times[0]) if len(self.times) else 0.0


@dataclass(frozen=True, eq=False)
class GripperState(Value):
    """Opening: `width` between the fingers [m] (0 where there are none), `fraction` of the full opening (0 closed, 1
    open), `force` [N]. `holding` says whether something is held, None where the gripper cannot tell."""

    width: float
    fraction: float
    force: float = 0.0
    holding: bool | None = None


@dataclass(frozen=True, eq=False)
class Wrench(Value):
    """A force [N] and a torque [Nm] at one point, along and about the axes of one frame."""

    force: Vec3
    torque: Vec3


@dataclass(frozen=True, eq=False)
class ArmState(Value):
    """One arm as its own sensors report it. `ee_pose` is T_world_tcp from forward kinematics."""

    arm_id: int
    joints: JointState
    gripper: GripperState
    ee_pose: Annotated[Se3Pose, WORLD]


@dataclass(frozen=True, eq=False)
class Observation(Value):
    """Everything a robot senses at one instant."""

    cameras: tuple[CameraObservation, ...]
    arm_states: tuple[ArmState, ...]
    stamp: float = 0.0


@dataclass(frozen=True, eq=False)
class ActionChunk(Value):
    """The next targets of one arm, `rate` [Hz] apart, the first one period from now; none where both are left out.

    Either `joints` (T, n) [rad] or T `poses`, T_world_tcp. `gripper` (T,) is the opening, 0 closed to 1 open; without
    it the gripper is left alone. `done` says that the policy has finished.
    """

    rate: float
    joints: Array | None = None
    poses: Annotated[tuple[Se3Pose, ...], WORLD] = ()
    gripper: Array | None = None
    done: bool = False

    def __post_init__(self) -> None:
        if self.joints is not None:
            object.__setattr__(self, "joints", frozen(self.joints, np.float64, (None, None), "ActionChunk.joints"))
        if self.gripper is not None:
            object.__setattr__(self, "gripper", frozen(self.gripper, np.float64, (None,), "ActionChunk.gripper"))


@dataclass(frozen=True, eq=False)
class Obstacle(Value):
    """A named piece of the collision world: a box, which contains all that is known besides.

    `points` (N, 3) [m] are what cameras saw of its surface, or, with `triangles` (F, 3) of indices into them, the
    vertices of a mesh. A `cylinder` fills the box, its axis along the box's z; the x and y extents are its radius.
    """

    name: str
    box: Annotated[OrientedBoundingBox, WORLD]
    points: Array | None = None
    triangles: Array | None = None
    cylinder: bool = False

    def __post_init__(self) -> None:
        if self.points is not None:
            object.__setattr__(self, "points", frozen(self.points, np.float64, (None, 3), "Obstacle.points"))
        if self.triangles is not None:
            object.__setattr__(self, "triangles", frozen(self.triangles, np.int64, (None, 3), "Obstacle.triangles"))


@dataclass(frozen=True, eq=False)
class WorldConfig(Value):
    """What a planner must not touch, in the world frame."""

    obstacles: tuple[Obstacle, ...] = ()


@dataclass(frozen=True, eq=False)
class Grasp(Value):
    """A candidate grasp: T_world_tcp `pose`, `score` (0 to 1), jaw `width` needed [m]."""

    pose: Annotated[Se3Pose, WORLD]
    score: float
    width: float


@dataclass(frozen=True, eq=False)
class ObjectMask(Value):
    """A named instance mask in one camera, by index into the observation's cameras."""

    name: str
    mask: Mask
    camera_index: int


@dataclass(frozen=True, eq=False)
class ObjectPose(Value):
    """A named ground-truth pose. Privileged."""

    name: str
    pose: Annotated[Se3Pose, WORLD]


CONTRACT_TYPES: dict[str, type] = {
    c.__name__: c
    for c in (
        Vec3, Quaternion, Se3Pose, OrientedBoundingBox, BoundingBox2D, Detection, Image, DepthImage, Mask, PointCloud,
        Matrix3x3, CameraObservation, JointState, Trajectory, GripperState, ArmState, Observation, Obstacle,
        WorldConfig, Grasp, ObjectMask, ObjectPose, Wrench, ActionChunk,
    )
}  # fmt: skip
SCALAR_TYPES: dict[str, type] = {"float": float, "int": int, "bool": bool, "string": str}
