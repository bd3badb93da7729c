"""Obstacles that are more than boxes: what makes a cylinder or a mesh one, and a mesh as voxels."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, Obstacle

INSIDE = 1e-3  # m a mesh may leave its box by
MOST_SAMPLES = 5_000_000


def check_shape(obstacle: Obstacle) -> None:
    """Raise `BadRequestError` (`shape`, `range`) for a cylinder that is not round or a mesh that is none."""
    name, extent = obstacle.name, obstacle.box.extent
    if obstacle.cylinder and (obstacle.points is not None or obstacle.triangles is not None):
        raise BadRequestError("shape", f"Obstacle {name!r} is a cylinder and has points as well.")
    if obstacle.cylinder and abs(extent.x - extent.y) > INSIDE:
        raise BadRequestError(
            "range",
            f"Obstacle {name!r} is a cylinder of radius {extent.x:g} and {extent.y:g} m.",
            hint="Make the x and y extents of its box the radius, and z half its height.",
        )
    if obstacle.triangles is None:
        return
    if obstacle.points is None or not len(obstacle.points) or not len(obstacle.triangles):
        raise BadRequestError("shape", f"Obstacle {name!r} is a mesh without vertices or without triangles.")
    low, high = int(obstacle.triangles.min()), int(obstacle.triangles.max())
    if low < 0 or high >= len(obstacle.points):
        raise BadRequestError(
            "range", f"Obstacle {name!r} has a triangle with vertex {min(low, high) if low < 0 else high}, of "
            f"{len(obstacle.points)} vertices.",
        )  # fmt: skip
    turn = obstacle.box.orientation.rotation.as_matrix()
    beyond = float((np.abs((obstacle.points - obstacle.box.center.array) @ turn) - extent.array).max())
    if beyond > INSIDE:
        raise BadRequestError(
            "range", f"The mesh of obstacle {name!r} leaves its box by {beyond:.3f} m.", hint="The box must contain it."
        )


def filled_mesh(vertices: Array, triangles: Array, low: Array, cell: float) -> Array:
    """Voxels (X, Y, Z) that a mesh passes through or encloses, of `cell` [m], the first one's corner at `low` (3,)."""
    from scipy.ndimage import binary_fill_holes

    index = np.floor((_samples(vertices, triangles, cell / 2) - low) / cell + 1e-9).astype(int)
    solid = np.zeros(index.max(axis=0) + 1, dtype=bool)
    solid[tuple(index.T)] = True
    return np.asarray(binary_fill_holes(solid))


def _samples(vertices: Array, triangles: Array, spacing: float) -> Array:
    """Points (M, 3) on all triangles, no farther apart than `spacing` [m] along their sides."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    longest = np.max([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    steps = 2 ** np.ceil(np.log2(np.maximum(longest / spacing, 1.0))).astype(int)  # few different ones
    if (wanted := float((steps.astype(float) ** 2).sum())) > MOST_SAMPLES:
        raise BadRequestError(
            "too_large",
            f"A mesh of {len(triangles)} triangles needs {wanted:.0f} samples; at most {MOST_SAMPLES} are taken.",
            hint="Cut it into parts, or leave out what is out of reach.",
        )
    found = []
    for n in np.unique(steps):
        i, j = np.array(np.nonzero(np.add.outer(np.arange(n + 1), np.arange(n + 1)) <= n)) / n
        of = steps == n
        side, other = (b - a)[of, None], (c - a)[of, None]
        found.append((a[of, None] + side * i[:, None] + other * j[:, None]).reshape(-1, 3))
    return np.concatenate(found)
