"""Carves a box by what cameras saw through, and wraps the rest in a closed, smoothed triangle mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_fill_holes, label
from scipy.sparse import coo_matrix, diags

from gap_perception.models.mesh_views import MaskedView
from gap_perception.scene.points import project
from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.types import Array, OrientedBoundingBox

CELLS = 40  # along the box's longest side
BEHIND = 1.0  # cells a voxel must lie in front of the measured depth to be seen through
SMOOTHING = ((0.5, -0.53), 6)  # Taubin's factors (1995) and rounds: smooths steps without shrinking
_CORNERS = {  # of a voxel's face by outward axis and sign, counter-clockwise seen from outside
    (0, 1): ((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)), (0, -1): ((0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)),
    (1, 1): ((0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)), (1, -1): ((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)),
    (2, 1): ((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)), (2, -1): ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)),
}  # fmt: skip


def build_mesh(views: Sequence[MaskedView], obb: OrientedBoundingBox) -> tuple[Array, Array]:
    """Vertices (V, 3) in the box's frame [m] and triangles (F, 3), outward and closed.

    Raises `PerceptionError` (`nothing_seen`) when no masked pixel lies in the box or all of it was seen through.
    """
    solid, cell = visual_hull(views, obb)
    vertices, faces = mesh_surface(solid)
    return _smooth(vertices, faces) * cell - obb.extent.array, faces


def visual_hull(views: Sequence[MaskedView], obb: OrientedBoundingBox) -> tuple[Array, Array]:
    """The largest connected part (X, Y, Z) of the box that no camera saw through, and the size of a voxel (3,) [m]."""
    size = 2 * np.maximum(obb.extent.array, 1e-4)
    shape = np.maximum(np.ceil(size / size.max() * CELLS).astype(int), 2)
    cell = size / shape
    centers = (np.indices(shape).reshape(3, -1).T + 0.5) * cell - obb.extent.array
    world = obb.orientation.rotation.apply(centers) + obb.center.array
    solid, touched = np.ones(len(world), dtype=bool), 0
    for view in views:
        columns, rows, depth = project(world, view.camera)
        height, width = view.mask.shape
        inside = np.flatnonzero((depth > 0) & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height))
        measured = view.camera.depth.data[rows[inside], columns[inside]].astype(float)
        known = np.isfinite(measured) & (measured > 0)
        gap = np.where(known, measured, 0.0) - depth[inside]
        on_object = view.mask[rows[inside], columns[inside]]
        touched += int((known & on_object & (np.abs(gap) < 2 * cell.max())).sum())
        solid[inside[known & (gap > BEHIND * cell.max())]] = False
    parts, count = label(solid.reshape(shape))
    if not touched or not count:
        raise PerceptionError("nothing_seen", "The masked pixels of the views show nothing inside the box.")
    largest = 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
    return np.asarray(binary_fill_holes(parts == largest)), cell


def mesh_surface(solid: Array) -> tuple[Array, Array]:
    """The surface of voxels: corners (V, 3) in cells, and closed triangles (F, 3), counter-clockwise from outside."""
    padded = np.pad(solid, 1)
    quads = []
    for (axis, sign), corners in _CORNERS.items():
        bare = padded & ~np.roll(padded, -sign, axis=axis)
        quads.append((np.argwhere(bare) - 1)[:, None, :] + np.array(corners))
    corner_list = np.concatenate(quads).reshape(-1, 3)
    vertices, index = np.unique(corner_list, axis=0, return_inverse=True)
    quad = index.reshape(-1, 4)
    return vertices.astype(float), np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def _smooth(vertices: Array, faces: Array) -> Array:
    a = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    pairs = np.concatenate([a, a[:, ::-1]])
    ones = np.ones(len(pairs))
    links = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(vertices),) * 2).tocsr()
    links.data[:] = 1.0
    mean = diags(1.0 / np.maximum(np.asarray(links.sum(axis=1)).ravel(), 1.0)) @ links
    factors, rounds = SMOOTHING
    for _ in range(rounds):
        for factor in factors:
            vertices = vertices + factor * (mean @ vertices - vertices)
    return vertices
