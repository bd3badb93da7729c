"""An object's surface from a partial cloud: normals, and the upright sides no camera saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import grey_closing
from scipy.spatial import cKDTree

from gap_runtime.contracts.scripting import cell_numbers
from gap_runtime.contracts.types import Array

SPACING = 0.003  # m between the points of a surface, and the side of a height map's cells
NEIGHBOURS = 12  # for a local plane: about the area of a fingertip
STEP = 0.006  # m of height between neighbouring cells from which the drop between them is taken for a wall
WALL_STEP = 0.004  # m of height between the samples of a wall
ALONG = 9  # neighbours along a wall's foot that straighten its stairs
MOST_CELLS = 1_000_000  # of a height map: stray points metres away must not fill the memory


@dataclass(frozen=True)
class Surface:
    """Points (N, 3) [m], outward unit normals (N, 3), and which of them are hypothesised rather than seen (N,)."""

    points: Array
    normals: Array
    guessed: Array

    @property
    def centroid(self) -> Array:
        """Middle of what was seen, shape (3,): each square of it counts once, however often cameras saw it."""
        seen = self.points[~self.guessed]
        low, high = seen.min(axis=0), seen.max(axis=0)
        cells = np.unique(np.floor(seen[:, :2] / SPACING).astype(int), axis=0)
        return np.append((cells + 0.5).mean(axis=0) * SPACING, (low[2] + high[2]) / 2)


def thinned(points: Array, spacing: float = SPACING) -> Array:
    """One point, the mean, per occupied cell of a grid, shape (M, 3)."""
    _, index, counts = np.unique(cell_numbers(points, spacing), return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(index.ravel(), points[:, i]) for i in range(3)], axis=1)
    return np.asarray(sums / counts[:, None])


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
    """The seen surface with an upright wall wherever it drops, down to `floor` [m] or to what was seen below.

    Things that stand on a support hide their far sides from most cameras; as a height map each is closed in the
    simplest way, rims, handles and hollows included.
    """
    seen = seen_surface(points)
    feet, facing, low, high = _drops(points, floor)
    if not len(feet):
        return seen
    feet, facing = _straightened(feet, facing)
    count = np.maximum(1, np.round((high - low) / WALL_STEP)).astype(int)
    index = np.repeat(np.arange(len(feet)), count)
    step = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count) + 0.5
    z = low[index] + step * ((high - low) / count)[index]
    walls = np.column_stack([feet[index], z])
    normals = np.column_stack([facing[index], np.zeros(len(index))])
    # A side that was seen is better known by what was seen than by the height map's stairs.
    known, _ = cKDTree(points).query(walls, distance_upper_bound=SPACING)
    walls, normals = walls[~np.isfinite(known)], normals[~np.isfinite(known)]
    guessed = np.concatenate([np.zeros(len(points), dtype=bool), np.ones(len(walls), dtype=bool)])
    inner = _reoriented(seen, feet, facing, low, high)
    return Surface(np.concatenate([points, walls]), np.concatenate([inner, normals]), guessed)


def _reoriented(seen: Surface, feet: Array, facing: Array, low: Array, high: Array) -> Array:
    """Seen normals beside a wall turned to its side: inside a hollow, outward is towards the object's middle."""
    distance, foot = cKDTree(feet).query(seen.points[:, :2], distance_upper_bound=2 * SPACING)
    near = np.nonzero(np.isfinite(distance))[0]
    foot = foot[near]
    z = seen.points[near, 2]
    side = np.einsum("ni,ni->n", seen.normals[near, :2], facing[foot])
    flip = (side < -0.5) & (z > low[foot]) & (z < high[foot])
    normals = seen.normals.copy()
    normals[near[flip]] *= -1
    return normals


def _drops(points: Array, floor: float) -> tuple[Array, Array, Array, Array]:
    """Where the height map drops: middles of the cells' sides (M, 2), the way down (M, 2), and from where to where."""
    origin = np.floor(points[:, :2].min(axis=0) / SPACING) - 2
    cells = (np.floor(points[:, :2] / SPACING) - origin).astype(int)
    shape = cells.max(axis=0) + 3
    empty = np.zeros((0, 2))
    if shape.prod() > MOST_CELLS:
        return empty, empty, np.zeros(0), np.zeros(0)
    height = np.full(shape, floor)
    np.maximum.at(height, (cells[:, 0], cells[:, 1]), points[:, 2])
    height = grey_closing(height, size=(3, 3))
    feet, facing, low, high = [], [], [], []
    for axis in range(2):
        one, two = (height[:-1], height[1:]) if axis == 0 else (height[:, :-1], height[:, 1:])
        at = np.argwhere(np.abs(one - two) > STEP)
        a, b = one[tuple(at.T)], two[tuple(at.T)]
        side = np.eye(2)[axis]
        feet.append((at + origin + 0.5 + 0.5 * side) * SPACING)
        facing.append(np.sign(a - b)[:, None] * side)
        low.append(np.minimum(a, b))
        high.append(np.maximum(a, b))
    return np.concatenate(feet), np.concatenate(facing), np.concatenate(low), np.concatenate(high)


def _straightened(feet: Array, facing: Array) -> tuple[Array, Array]:
    """A wall's stairs as the lines they stand for: each foot moved onto the line through its neighbours that face the
    same way, and facing across it."""
    _, index = cKDTree(feet).query(feet, k=min(ALONG, len(feet)))
    index = index.reshape(len(feet), -1)
    weight = (np.einsum("nki,ni->nk", facing[index], facing) > -0.5).astype(float)
    weight *= np.linalg.norm(feet[index] - feet[:, None], axis=2) < ALONG * SPACING
    total = weight.sum(axis=1, keepdims=True)
    middle = np.einsum("nk,nki->ni", weight, feet[index]) / total
    local = feet[index] - middle[:, None]
    _, vectors = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weight, local, local))
    across = vectors[:, :, 0]
    towards = np.einsum("nk,nki->ni", weight, facing[index])
    across = np.where(np.einsum("ni,ni->n", across, towards)[:, None] < 0, -across, across)
    lone = total[:, 0] < 3
    across[lone] = facing[lone]
    moved = feet - np.einsum("ni,ni->n", feet - middle, across)[:, None] * across
    return np.where(lone[:, None], feet, moved), across
