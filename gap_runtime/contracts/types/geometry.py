"""Points, rotations, poses and boxes, and the frames they are expressed in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.types.value import Array, Value

UNIT_TOLERANCE = 1e-3  # rounding to canonical files costs less; a quaternion farther off is a mistake


@dataclass(frozen=True)
class Frame:
    """Annotation marker: the frame a value is expressed in, as in `Annotated[PointCloud, WORLD]`."""

    name: str


WORLD = Frame("world")
CAMERA = Frame("camera")
BASE = Frame("base")
TCP = Frame("tcp")
FRAMES = (WORLD.name, CAMERA.name, BASE.name, TCP.name)


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

    def __post_init__(self) -> None:
        norm = math.sqrt(self.w * self.w + self.x * self.x + self.y * self.y + self.z * self.z)
        if not abs(norm - 1.0) <= UNIT_TOLERANCE:
            raise ValueError(f"Quaternion must have unit norm, got {norm:.6g} (order is w, x, y, z)")

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

    def moved(self, offset: ArrayLike) -> Se3Pose:
        """The pose moved by `offset` (3,) [m] along the body's own axes."""
        return Se3Pose(Vec3.of(self.position.array + self.rotation.rotation.apply(offset)), self.rotation)

    def turned(self, by: Rotation) -> Se3Pose:
        """The pose turned about the body's own axes."""
        return Se3Pose(self.position, Quaternion.of(self.rotation.rotation * by))


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

    def extent_along(self, direction: ArrayLike) -> float:
        """Full extent along a unit vector (3,) given in the box's frame of reference [m]."""
        return float(2 * np.abs(self.orientation.rotation.inv().apply(direction)) @ self.extent.array)


@dataclass(frozen=True, eq=False)
class BoundingBox2D(Value):
    """Pixel rectangle, x to the right, y down; max is exclusive."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float
