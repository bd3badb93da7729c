"""The values that flow along edges: frozen dataclasses over numpy.

Units are metres, radians, seconds, newtons, kilograms. Quaternions are (w, x, y, z), unit norm. `T_a_b` maps
coordinates in frame b to frame a. The camera frame is the optical one: x right, y down, z forward (OpenCV).
Arrays are made read-only on construction, so a value handed to two parallel branches cannot be changed by one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[Any]


@dataclass(frozen=True)
class Frame:
    """Annotation marker: the frame a value is expressed in, as in `Annotated[PointCloud, WORLD]`."""

    name: str


WORLD = Frame("world")
CAMERA = Frame("camera")
BASE = Frame("base")


def _frozen(value: ArrayLike, dtype: Any, shape: tuple[int | None, ...], what: str) -> Array:
    array = np.asarray(value, dtype=dtype)
    if array.ndim != len(shape) or any(w is not None and w != h for w, h in zip(shape, array.shape, strict=False)):
        want = "x".join("N" if s is None else str(s) for s in shape)
        raise ValueError(f"{what} must have shape {want}, got {'x'.join(map(str, array.shape)) or 'a scalar'}")
    if array.flags.writeable:
        array = array.copy() if array.base is not None or array is value else array
        array.flags.writeable = False
    return array


class Value:
    """Base of all contract types; equality compares arrays element-wise."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return a is not None and b is not None and np.array_equal(a, b, equal_nan=True)
    return bool(a == b)


@dataclass(frozen=True, eq=False)
class Vec3(Value):
    """A point or a direction [m]."""

    x: float
    y: float
    z: float

    @classmethod
    def of(cls, v: ArrayLike) -> Self:
        """From any 3-sequence."""
        x, y, z = np.asarray(v, dtype=float).reshape(3)
        return cls(float(x), float(y), float(z))

    @property
    def array(self) -> Array:
        """Shape (3,)."""
        return np.array([self.x, self.y, self.z])


@dataclass(frozen=True, eq=False)
class Quaternion(Value):
    """A rotation as a unit quaternion, scalar first."""

    w: float
    x: float
    y: float
    z: float

    @classmethod
    def of(cls, rotation: Rotation) -> Self:
        """From a scipy rotation, with w >= 0 so that equal rotations are equal values."""
        x, y, z, w = (float(v) for v in rotation.as_quat(canonical=True))
        return cls(w, x, y, z)

    @property
    def rotation(self) -> Rotation:
        """As a scipy rotation."""
        return Rotation.from_quat([self.x, self.y, self.z, self.w])


@dataclass(frozen=True, eq=False)
class Se3Pose(Value):
    """A rigid transform T_frame_body: `position` [m] and `rotation` of the body in the frame."""

    position: Vec3
    rotation: Quaternion

    @classmethod
    def of(cls, T: ArrayLike) -> Self:
        """From a homogeneous matrix, shape (4, 4)."""
        M = np.asarray(T, dtype=float).reshape(4, 4)
        return cls(Vec3.of(M[:3, 3]), Quaternion.of(Rotation.from_matrix(M[:3, :3])))

    @property
    def matrix(self) -> Array:
        """Homogeneous matrix, shape (4, 4)."""
        T = np.eye(4)
        T[:3, :3] = self.rotation.rotation.as_matrix()
        T[:3, 3] = self.position.array
        return T


@dataclass(frozen=True, eq=False)
class OrientedBoundingBox(Value):
    """A box: `center`, `extent` = half-extents along its own axes [m], `orientation` of those axes."""

    center: Vec3
    extent: Vec3
    orientation: Quaternion

    @property
    def corners(self) -> Array:
        """The eight corners in the box's frame of reference, shape (8, 3) [m]."""
        signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
        return np.asarray(self.orientation.rotation.apply(signs * self.extent.array) + self.center.array)


@dataclass(frozen=True, eq=False)
class BoundingBox2D(Value):
    """Pixel rectangle, x to the right, y down; max is exclusive."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float


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
        object.__setattr__(self, "data", _frozen(self.data, np.uint8, (None, None, 3), "Image.data"))


@dataclass(frozen=True, eq=False)
class DepthImage(Value):
    """Distance along the optical axis [m], `data` float32 of shape (H, W); 0 or NaN where unknown."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", _frozen(self.data, np.float32, (None, None), "DepthImage.data"))


@dataclass(frozen=True, eq=False)
class Mask(Value):
    """Boolean image, `data` bool of shape (H, W)."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", _frozen(self.data, np.bool_, (None, None), "Mask.data"))


@dataclass(frozen=True, eq=False)
class PointCloud(Value):
    """Points [m], `points` float64 of shape (N, 3); optional `colors` uint8 of shape (N, 3)."""

    points: Array
    colors: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _frozen(self.points, np.float64, (None, 3), "PointCloud.points"))
        if self.colors is not None:
            object.__setattr__(self, "colors", _frozen(self.colors, np.uint8, (None, 3), "PointCloud.colors"))


@dataclass(frozen=True, eq=False)
class Matrix3x3(Value):
    """A 3x3 matrix, such as camera intrinsics [px]."""

    data: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", _frozen(self.data, np.float64, (3, 3), "Matrix3x3.data"))


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
                object.__setattr__(self, name, _frozen(getattr(self, name), np.float64, (None,), f"JointState.{name}"))


@dataclass(frozen=True, eq=False)
class Trajectory(Value):
    """Joint motion: `times` [s] shape (T,) from 0, `positions` [rad] and `velocities` [rad/s] shape (T, n)."""

    times: Array
    positions: Array
    velocities: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", _frozen(self.times, np.float64, (None,), "Trajectory.times"))
        shape = (len(self.times), None)
        object.__setattr__(self, "positions", _frozen(self.positions, np.float64, shape, "Trajectory.positions"))
        if self.velocities is not None:
            object.__setattr__(self, "velocities", _frozen(self.velocities, np.float64, shape, "Trajectory.velocities"))

    @property
    def duration(self) -> float:
        """Length in time [s]."""
        return float(self.times[-1] - self.times[0]) if len(self.times) else 0.0


@dataclass(frozen=True, eq=False)
class GripperState(Value):
    """Jaw opening: `width` between the fingers [m], `fraction` of the full opening (0 closed, 1 open), `force` [N]."""

    width: float
    fraction: float
    force: float = 0.0


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
class Obstacle(Value):
    """A named piece of the collision world: a box, and, where known, the `points` it was built from (N, 3) [m]."""

    name: str
    box: Annotated[OrientedBoundingBox, WORLD]
    points: Array | None = None

    def __post_init__(self) -> None:
        if self.points is not None:
            object.__setattr__(self, "points", _frozen(self.points, np.float64, (None, 3), "Obstacle.points"))


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
        WorldConfig, Grasp, ObjectMask, ObjectPose,
    )
}  # fmt: skip
SCALAR_TYPES: dict[str, type] = {"float": float, "int": int, "bool": bool, "string": str}
