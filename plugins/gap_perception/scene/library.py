"""What the task's object models look like, as coloured surface points learned from rendered views of each alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial.transform import Rotation

from gap_perception.scene.colours import hue_histogram, perceptual
from gap_runtime.contracts.task import ObjectModel, Task
from gap_runtime.contracts.task.rendering import ObjectRenderer, ObjectView
from gap_runtime.contracts.types import Array, CameraObservation

CELL = 0.003  # m: grid of surface points
PAD = 0.03  # m: how far from the surface the nearest surface point is still looked up
YAWS = (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)
SIDES, BELOW = (15.0, 50.0), -45.0
TOP = 89.9
FLAT = 0.15  # cosine below which a surface is seen too flatly to learn from


@dataclass(frozen=True)
class SurfaceModel:
    """One object model as its surface: `points`, outward `normals` (M, 3) in the object's frame [m], `colours` (M, 3).

    `nearest` maps a cell of the grid that starts at `origin` to the index of the nearest surface point.
    """

    name: str
    model: ObjectModel
    points: Array
    normals: Array
    colours: Array
    origin: Array
    nearest: Array

    @property
    def is_round(self) -> bool:
        """True when turning it about its z axis leaves its shape the same."""
        return self.model.shape.kind == "cylinder"

    @cached_property
    def hues(self) -> Array:
        """Histogram of the surface's hues, see `hue_histogram`."""
        return hue_histogram(self.colours)

    def lookup(self, local: Array) -> Array:
        """Index of the nearest surface point of points (..., 3) in the object's frame; clamped outside the grid."""
        _, rows, layers = self.nearest.shape
        cell = (local - self.origin) / CELL
        np.clip(cell, 0, np.array(self.nearest.shape) - 1, out=cell)
        cell = cell.astype(np.int64)
        return np.asarray(self.nearest.ravel()[(cell[..., 0] * rows + cell[..., 1]) * layers + cell[..., 2]])


def build_library(task: Task, render: ObjectRenderer) -> dict[str, SurfaceModel]:
    """Render every object model of the task alone and learn its surface; seconds, and nothing but the models."""
    views = render(task.objects, yaws_deg=YAWS, elevations_deg=SIDES)
    views += render(task.objects, yaws_deg=YAWS[::2], elevations_deg=(BELOW, TOP))
    return {name: learn(name, model, [v for v in views if v.name == name]) for name, model in task.objects.items()}


def learn(name: str, model: ObjectModel, views: Sequence[ObjectView]) -> SurfaceModel:
    """Fuse views of one model into surface points on a grid."""
    parts = [_surface(v.observation, v.mask.data, v.yaw_deg) for v in views]
    return fuse(name, model, *(np.concatenate(column) for column in zip(*parts, strict=True)))


def fuse(name: str, model: ObjectModel, points: Array, normals: Array, colours: Array, weights: Array) -> SurfaceModel:
    """Average samples of a model's surface, each (N, 3), over a grid, by their `weights` (N,)."""
    origin = points.min(axis=0) - PAD
    shape = np.ceil((points.max(axis=0) + PAD - origin) / CELL).astype(int) + 1
    cells = np.ravel_multi_index(tuple(((points - origin) / CELL).astype(int).T), shape)
    used, inverse = np.unique(cells, return_inverse=True)
    points, normals, colours = (_weighted(values, inverse, weights) for values in (points, normals, colours))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    index = np.full(shape.prod(), -1)
    index[used] = np.arange(len(used))
    index = index.reshape(shape)
    where = distance_transform_edt(index < 0, return_distances=False, return_indices=True)
    return SurfaceModel(name, model, points, normals, colours, origin, index[tuple(where)].astype(np.int32))


def _surface(frame: CameraObservation, mask: Array, yaw_deg: float) -> tuple[Array, Array, Array, Array]:
    """Points, normals and colours in the object's frame, and weights, of one view; grazing pixels count little."""
    K, T = frame.intrinsics.data, frame.pose.matrix
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    z, v, u = frame.depth.data[window].astype(float), *np.mgrid[window]
    camera = np.stack([(u - K[0, 2]) / K[0, 0] * z, (v - K[1, 2]) / K[1, 1] * z, z], axis=-1)
    normal = np.cross(np.gradient(camera, axis=0), np.gradient(camera, axis=1))
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 1e-12)
    facing = -(normal * camera).sum(-1) / np.maximum(np.linalg.norm(camera, axis=-1), 1e-9)
    normal *= np.sign(facing)[..., None]
    keep = _inner(mask)[window] & (np.abs(facing) > FLAT)
    R = Rotation.from_euler("z", -yaw_deg, degrees=True).as_matrix()
    points = (camera[keep] @ T[:3, :3].T + T[:3, 3]) @ R.T
    normals = normal[keep] @ T[:3, :3].T @ R.T
    return points, normals, perceptual(frame.rgb.data[window])[keep], facing[keep] ** 2


def _inner(mask: Array) -> Array:
    """The mask without its outermost pixels, whose normals straddle the background."""
    import cv2

    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0)
    return np.asarray(inner.astype(bool))


def _weighted(values: Array, groups: Array, weights: Array) -> Array:
    total = np.bincount(groups, weights=weights)
    sums = [np.bincount(groups, weights=weights * values[:, i]) for i in range(3)]
    return np.asarray(np.column_stack(sums) / total[:, None])
