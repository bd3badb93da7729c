"""How far apart two things stand on a surface: exact distances between discs and turned rectangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gap_mujoco.model.files import silhouette
from gap_runtime.contracts.task import Shape
from gap_runtime.contracts.task.container_geometry import body_centre
from gap_runtime.contracts.types import Array

AROUND = 48  # corners of a round outline


class Footprint(NamedTuple):
    """The Minkowski sum of a convex polygon (or a point), `corners` (N, 2), and a disc of `radius` [m]."""

    corners: Array
    radius: float


def footprint(shape: Shape, xy: Array, yaw: float) -> Footprint:
    """Of a shape standing at `xy` [m], turned by `yaw` [rad]."""
    if shape.kind == "mesh":
        return Footprint(_turned(silhouette(shape), xy, yaw), 0.0)
    x, y = shape.size[0] / 2, shape.size[1] / 2
    if shape.kind == "cylinder":
        return Footprint(np.asarray(xy, float).reshape(1, 2), max(x, y))
    return Footprint(_turned(np.array([[x, y], [-x, y], [-x, -y], [x, -y]]), xy, yaw), 0.0)


def _turned(corners: Array, xy: Array, yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.asarray(corners @ np.array([[c, s], [-s, c]]) + xy)


def outline(shape: Shape) -> Array:
    """Corners (N, 2) [m], in order, of what of a standing shape covers a surface, in its frame: of a pan, its body."""
    if shape.kind in ("cylinder", "pan", "mug"):
        angles = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
        middle = body_centre(shape) if shape.handle else 0.0
        return np.column_stack([np.cos(angles), np.sin(angles)]) * shape.size[1] / 2 + [middle, 0.0]
    return footprint(shape, np.zeros(2), 0.0).corners


def clearance(a: Footprint, b: Footprint) -> float:
    """Distance between two footprints [m]; zero or less where they overlap."""
    if _overlap(a.corners, b.corners):
        return -(a.radius + b.radius)
    nearest = min(_nearest(a.corners, b.corners), _nearest(b.corners, a.corners))
    return nearest - a.radius - b.radius


def _overlap(a: Array, b: Array) -> bool:
    """Separating axes of two convex polygons."""
    for polygon in (a, b):
        if len(polygon) < 3:
            continue
        edges = np.roll(polygon, -1, axis=0) - polygon
        for normal in np.column_stack([edges[:, 1], -edges[:, 0]]):
            on_a, on_b = a @ normal, b @ normal
            if on_a.max() < on_b.min() or on_b.max() < on_a.min():
                return False
    return len(a) > 2 or len(b) > 2 or bool(np.array_equal(a, b))


def _nearest(points: Array, polygon: Array) -> float:
    """From any of the points to the polygon's edge."""
    start, along = polygon, np.roll(polygon, -1, axis=0) - polygon
    offset = points[:, None, :] - start[None]
    share = np.clip((offset * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-12), 0, 1)
    return float(np.linalg.norm(offset - share[..., None] * along, axis=-1).min())
