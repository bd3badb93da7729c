"""The planner's scene as VAMP's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from gap_motion.collision.primitives import PrimitiveScene
from gap_runtime.contracts.types import Array


def environment(scene: PrimitiveScene, vamp: Any, margin: float) -> Any:
    """VAMP's own scene, everything grown by `margin`."""
    out = vamp.Environment()
    angles = euler_xyz(np.array([box.turn.T for box in scene.boxes]).reshape(-1, 3, 3))
    for box, euler in zip(scene.boxes, angles, strict=True):
        half = box.half + min(margin, box.most)
        out.add_cuboid(vamp.Cuboid(box.center.tolist(), euler.tolist(), half.tolist()))
    for *center, radius in scene.spheres.tolist():
        out.add_sphere(vamp.Sphere(center, radius + margin))
    return out


def euler_xyz(R: Array) -> Array:
    """Angles about the fixed x, y and z axes, in that order, of rotation matrices (B, 3, 3); shape (B, 3).

    scipy's would warn where y is a right angle; there, z is zero.
    """
    level = np.hypot(R[:, 0, 0], R[:, 1, 0])
    x = np.where(level > 1e-9, np.arctan2(R[:, 2, 1], R[:, 2, 2]), np.arctan2(-R[:, 1, 2], R[:, 1, 1]))
    z = np.where(level > 1e-9, np.arctan2(R[:, 1, 0], R[:, 0, 0]), 0.0)
    return np.stack([x, np.arctan2(-R[:, 2, 0], level), z], axis=1)
