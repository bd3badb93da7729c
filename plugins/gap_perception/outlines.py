"""Distance between convex outlines seen from above."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.types import Array


def outline_gap(a: Array, b: Array) -> float:
    """Smallest distance between two convex polygons (N, 2), negative when they overlap [m].

    Separating axes give the overlap; apart, the distance is between a corner of one and an edge of the other.
    """
    separation = max(_separation(a, b), _separation(b, a))
    if separation <= 0:
        return separation
    return min(_corner_gap(a, b), _corner_gap(b, a))


def _separation(a: Array, b: Array) -> float:
    edges = np.roll(a, -1, axis=0) - a
    normals = np.column_stack([edges[:, 1], -edges[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return float(((b[None] - a[:, None]) * normals[:, None]).sum(-1).min(axis=1).max())


def _corner_gap(a: Array, b: Array) -> float:
    start, edge = b[None], (np.roll(b, -1, axis=0) - b)[None]
    t = np.clip(((a[:, None] - start) * edge).sum(-1) / (edge**2).sum(-1), 0, 1)
    return float(np.linalg.norm(a[:, None] - start - t[..., None] * edge, axis=-1).min())
