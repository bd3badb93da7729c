"""Ground truth at one instant, and the predicates checkpoints and success conditions are written in.

An expression sees `w`: `w.body("basket")`, `w.joint("knob")`, `w.gripper_width()`, `w.time`. Names are the task's
object ids; a label ("alphabet soup") finds its id.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.types import WORLD, Array, OrientedBoundingBox, Se3Pose, Vec3

SETTLED_LINEAR = 0.01  # m/s: below this, and
SETTLED_ANGULAR = 0.1  # rad/s: below this, a body counts as at rest
CONTAINED_MARGIN = 0.01  # m: how far below a cavity's floor a body's origin may be (LIBERO relaxes its box by 1 cm)


@dataclass(frozen=True)
class BodyState:
    """One object. `box` is its bounding box now; `cavity` the free space inside a container, both in the world frame.

    `parts` are the named parts of its model, `outline` the corners (N, 2) [m] of the
    convex area it covers seen from above. `contacts` names what it touches: object ids (`stove:knob`
    for a link), supports, or `robot:<arm>:<link>`; fingers are `robot:<arm>:left_finger`, `robot:<arm>:right_finger`.
    """

    name: str
    pose: Annotated[Se3Pose, WORLD]
    box: Annotated[OrientedBoundingBox, WORLD]
    linear_speed: float
    angular_speed: float
    contacts: frozenset[str]
    cavity: Annotated[OrientedBoundingBox, WORLD] | None = None
    parts: Mapping[str, Annotated[OrientedBoundingBox, WORLD]] = field(default_factory=dict)
    outline: Array | None = None


@dataclass(frozen=True)
class ArmTruth:
    """One arm: true joint positions [rad], TCP pose and jaw opening [m]."""

    joints: tuple[float, ...]
    tcp: Annotated[Se3Pose, WORLD]
    gripper_width: float


@dataclass(frozen=True)
class WorldSnapshot:
    """Everything that is true at `time`; `start` is the snapshot taken right after reset (None on that one)."""

    time: float
    bodies: Mapping[str, BodyState]
    joints: Mapping[str, float]
    arms: tuple[ArmTruth, ...]
    labels: Mapping[str, str] = field(default_factory=dict)
    start: WorldSnapshot | None = None

    def body(self, name: str) -> BodyView:
        """The body with this id or label. Raises `UnknownNameError`."""
        by_label = {label: key for key, label in self.labels.items()}
        key = name if name in self.bodies else by_label.get(name, name)
        if key not in self.bodies:
            raise UnknownNameError("body", name, self.bodies)
        return BodyView(self, self.bodies[key])

    def joint(self, name: str) -> float:
        """Position of an articulated joint [rad or m]."""
        if name not in self.joints:
            raise UnknownNameError("joint", name, self.joints)
        return self.joints[name]

    def gripper_width(self, arm: int = 0) -> float:
        """Jaw opening [m]."""
        return self.arms[arm].gripper_width


class BodyView:
    """The questions one may ask of a body. Distances in metres."""

    def __init__(self, world: WorldSnapshot, state: BodyState) -> None:
        self._cell, self._state = world, state

    @property
    def x(self) -> float:
        """Position of the origin along world x."""
        return self._state.pose.position.x

    @property
    def y(self) -> float:
        """Position of the origin along world y."""
        return self._state.pose.position.y

    @property
    def z(self) -> float:
        """Height of the origin."""
        return self._state.pose.position.z

    def bottom(self) -> float:
        """Height of the lowest corner of its bounding box."""
        return float(self._state.box.corners[:, 2].min())

    def top(self) -> float:
        """Height of the highest corner of its bounding box."""
        return float(self._state.box.corners[:, 2].max())

    def lifted(self) -> float:
        """How far the origin has risen since reset."""
        start = self._cell.start
        return 0.0 if start is None else self.z - start.bodies[self._state.name].pose.position.z

    def moved(self) -> float:
        """How far the origin has moved since reset."""
        start = self._cell.start
        if start is None:
            return 0.0
        return float(np.linalg.norm(self._position - start.bodies[self._state.name].pose.position.array))

    def distance_to(self, other: BodyView) -> float:
        """Between origins."""
        return float(np.linalg.norm(self._position - other._position))

    def xy_distance_to(self, other: BodyView) -> float:
        """Between origins, in the ground plane."""
        return float(np.linalg.norm((self._position - other._position)[:2]))

    def tilt_deg(self) -> float:
        """Angle between its own z axis now and at reset."""
        start = self._cell.start
        if start is None:
            return 0.0
        up = [s.rotation.rotation.apply([0, 0, 1]) for s in (self._state.pose, start.bodies[self._state.name].pose)]
        return float(np.degrees(np.arccos(np.clip(up[0] @ up[1], -1, 1))))

    def touches(self, other: str) -> bool:
        """In contact with the named body, support, or `robot` for any part of any robot."""
        return any(c == other or c.startswith(other + ":") for c in self._state.contacts)

    def is_grasped(self, arm: int = 0) -> bool:
        """Both fingers of the arm touch it."""
        need = {f"robot:{arm}:left_finger", f"robot:{arm}:right_finger"}
        return need <= self._state.contacts

    def is_released(self) -> bool:
        """No part of any robot touches it."""
        return not self.touches("robot")

    def is_settled(self) -> bool:
        """At rest."""
        return self._state.linear_speed < SETTLED_LINEAR and self._state.angular_speed < SETTLED_ANGULAR

    def is_in(self, container: BodyView) -> bool:
        """Its origin is inside the container's cavity (whose floor is relaxed by `CONTAINED_MARGIN`)."""
        cavity = container._state.cavity
        if cavity is None:
            return False
        p = cavity.orientation.rotation.inv().apply(self._position - cavity.center.array)
        half = cavity.extent.array
        return bool(np.all(np.abs(p[:2]) <= half[:2]) and -half[2] - CONTAINED_MARGIN <= p[2] <= half[2])

    def is_on(self, other: BodyView) -> bool:
        """It touches `other` and its origin is above the other's."""
        return self.touches(other._state.name) and self.z > other.z

    def coverage(self, other: BodyView, part: str) -> float:
        """Share (0 to 1) of a part of `other`, the disc in its box seen from above, that lies under this body."""
        box, corners = other._state.parts.get(part), self._state.outline
        if box is None:
            raise UnknownNameError(f"part of {other._state.name}", part, other._state.parts)
        if corners is None:
            return 0.0
        grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * 2), axis=-1).reshape(-1, 2)
        disc = grid[np.hypot(*grid.T) <= 1] * box.extent.array[:2]
        points = (
            box.center.array + np.column_stack([disc, np.zeros(len(disc))]) @ box.orientation.rotation.as_matrix().T
        )
        edges = np.roll(corners, -1, axis=0) - corners
        offset = points[:, None, :2] - corners
        inside = edges[:, 0] * offset[..., 1] - edges[:, 1] * offset[..., 0] >= 0
        return float(inside.all(axis=1).mean())

    def is_above(self, other: BodyView) -> bool:
        """Its origin is over the other's footprint and its bottom is not below the other's origin."""
        box = other._state.box
        p = box.orientation.rotation.inv().apply(self._position - box.center.array)
        return bool(np.all(np.abs(p[:2]) <= box.extent.array[:2]) and self.bottom() > other.z)

    @property
    def _position(self) -> Array:
        return self._state.pose.position.array

    @property
    def size(self) -> Vec3:
        """Full extents of the bounding box along its own axes."""
        return Vec3.of(2 * self._state.box.extent.array)


WORLD_API: dict[str, frozenset[str]] = {
    "world": frozenset({"body", "joint", "gripper_width", "time"}),
    "body": frozenset(n for n in vars(BodyView) if not n.startswith("_")),
}
