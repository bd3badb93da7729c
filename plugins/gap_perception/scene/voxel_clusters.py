"""Groups points that touch each other, over all cameras at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gap_runtime.contracts.types import Array

VOXEL = 0.004  # m
LINK = 0.008  # m: points closer than this belong together; tasks keep objects a centimetre apart or let them touch


class Voxels(NamedTuple):
    """Points averaged over a grid: `centers` (M, 3) [m], `of_point` (N,) the voxel of each point, `counts` (M,)."""

    centers: Array
    of_point: Array
    counts: Array


def voxelise(xyz: Array, size: float = VOXEL) -> Voxels:
    """Average points (N, 3) over cubes of `size`."""
    if not len(xyz):
        return Voxels(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    grid = np.floor(xyz / size).astype(np.int64)
    grid -= grid.min(axis=0)
    spans = grid.max(axis=0) + 1
    keys = (grid[:, 0] * spans[1] + grid[:, 1]) * spans[2] + grid[:, 2]
    _, of_point, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(of_point, weights=xyz[:, i]) for i in range(3)]
    return Voxels(np.column_stack(sums) / counts[:, None], of_point, counts)


class NeighbourGraph:
    """Which points of a cloud (N, 3) are neighbours, worked out once, so that subsets can be grouped at little cost."""

    def __init__(self, points: Array, link: float = LINK) -> None:
        self._count = len(points)
        self._pairs = cKDTree(points).query_pairs(link, output_type="ndarray") if len(points) else np.zeros((0, 2), int)

    def clusters(self, members: Array) -> list[Array]:
        """Indices (sorted) of each connected part of the subset `members` (indices), largest part first."""
        inside = np.zeros(self._count, dtype=bool)
        inside[members] = True
        pairs = self._pairs[inside[self._pairs[:, 0]] & inside[self._pairs[:, 1]]]
        graph = coo_matrix((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(self._count, self._count))
        _, labels = connected_components(graph, directed=False)
        labels = labels[members]
        order = np.argsort(labels, kind="stable")
        cuts = np.flatnonzero(np.diff(labels[order])) + 1
        parts = [np.sort(members[part]) for part in np.split(order, cuts)] if len(members) else []
        return sorted(parts, key=lambda part: (-len(part), int(part[0])))
