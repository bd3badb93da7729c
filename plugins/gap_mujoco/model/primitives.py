"""The primitives that an object's collision geometry is made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


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
