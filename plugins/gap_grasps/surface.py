"""An object's surface from a partial cloud: normals, and the sides no camera saw closed down to the support."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from gap_cli.contracts.types import Array

NEIGHBOURS = 12  # for a local plane; a dozen is enough at the 2-4 mm spacing of a tabletop cloud
WALL_STEP = 0.004  # m between the samples of a closed side


@dataclass(frozen=True)
class Surface:
    """Points (N, 3) [m], outward unit normals (N, 3), and which of them are hypothesised rather than seen (N,)."""

    points: Array
    normals: Array
    guessed: Array

    @property
    def centroid(self) -> Array:
        """Middle of the bounding box, shape (3,): less biased by where the cameras stood than the mean."""
        return np.asarray((self.points.min(axis=0) + self.points.max(axis=0)) / 2)


def estimate_normals(points: Array) -> Array:
    """Unit normals (N, 3) by local principal components (Hoppe et al. 1992), pointing away from the cloud's middle."""
    k = min(NEIGHBOURS, len(points))
    _, index = cKDTree(points).query(points, k=k)
    local = points[np.atleast_2d(index)] - points[np.atleast_2d(index)].mean(axis=1, keepdims=True)
    _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", local, local))
    normals = vectors[:, :, 0]
    outward = points - (points.min(axis=0) + points.max(axis=0)) / 2
    flip = np.einsum("ni,ni->n", normals, outward) < 0
    return np.where(flip[:, None], -normals, normals)


def seen_surface(points: Array) -> Surface:
    """The surface the cloud shows, nothing added."""
    return Surface(points, estimate_normals(points), np.zeros(len(points), dtype=bool))


def closed_surface(points: Array, floor: float) -> Surface:
    """The seen surface with upright walls along its footprint, from `floor` [m] to the top of what was seen there.

    Things that stand on a support hide their far sides; their footprint's convex hull is the simplest closed guess.
    """
    seen = seen_surface(points)
    try:
        hull = ConvexHull(points[:, :2])
    except QhullError:
        return seen
    corners = points[hull.vertices, :2]
    tops = points[hull.vertices, 2]
    walls, normals = [seen.points], [seen.normals]
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        edge = corners[j] - corners[i]
        length = float(np.linalg.norm(edge))
        height = max(float(min(tops[i], tops[j])), float(np.quantile(points[:, 2], 0.5))) - floor
        if length < 1e-6 or height <= 0:
            continue
        along = (np.arange(max(1, round(length / WALL_STEP))) + 0.5) / max(1, round(length / WALL_STEP))
        up = floor + (np.arange(max(1, round(height / WALL_STEP))) + 0.5) * height / max(1, round(height / WALL_STEP))
        grid_a, grid_u = (g.ravel() for g in np.meshgrid(along, up))
        walls.append(np.column_stack([corners[i] + grid_a[:, None] * edge, grid_u]))
        normals.append(np.tile([edge[1] / length, -edge[0] / length, 0.0], (len(grid_a), 1)))
    guessed = np.concatenate([np.zeros(len(points), dtype=bool), np.ones(sum(map(len, walls[1:])), dtype=bool)])
    return Surface(np.concatenate(walls), np.concatenate(normals), guessed)
