"""The primitives that an object's collision geometry is made of, and what all its geoms share."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from gap_runtime.contracts.task import ObjectModel

VISUAL, COLLISION = 2, 3  # geom groups
VISUAL_ONLY: dict[str, Any] = {"group": VISUAL, "contype": 0, "conaffinity": 0, "mass": 0}


def contact_attributes(model: ObjectModel) -> dict[str, Any]:
    """MJCF attributes of every collision geom of an object."""
    return {
        "group": COLLISION, "friction": (model.friction, 0.005, 0.0001), "condim": 4, "solref": (0.006, 1),
        "solimp": (0.95, 0.99, 0.001),
    }  # fmt: skip


class CollisionPrimitive(NamedTuple):
    """One collision primitive: MuJoCo type, its size parameters [m], its centre in the object's frame [m], and how far
    it is turned about the object's z axis [rad]."""

    kind: str
    size: tuple[float, ...]
    centre: tuple[float, float, float]
    yaw: float = 0.0

    @property
    def volume(self) -> float:
        """[m^3]."""
        if self.kind == "cylinder":
            return float(2 * np.pi * self.size[0] ** 2 * self.size[1])
        return float(8 * np.prod(self.size))

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Orientation in the object's frame, w first."""
        return float(np.cos(self.yaw / 2)), 0.0, 0.0, float(np.sin(self.yaw / 2))
