"""Lays object models onto points at any tilt: for what leans on something else and rests on none of its sides.

Method: point-to-plane ICP as in `fit`, over all six degrees of freedom, from starts along the points' principal axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from gap_perception.scene.colours import hue_histogram, overlap
from gap_perception.scene.fit import SUNK, TIGHT, TURN_SIGMA, WRONG, Fit, surface_distances
from gap_perception.scene.library import SurfaceModel
from gap_perception.scene.observed_points import ObservedPoints
from gap_perception.scene.propose import NO_HUES, SIDE_SLACK, sample
from gap_perception.scene.visibility import DepthView
from gap_runtime.contracts.types import Array

TILTED = -1  # the `rest` of a model that lies on none of its sides
LOOKED_AT = 240  # points a fit looks at
ROUNDS, LOOSE = 14, 0.02  # steps, and scale of the first one's robust weights [m]
TURNS = 4  # about the body's own axis


def fit_tilted(library: Mapping[str, SurfaceModel], part: ObservedPoints, views: Sequence[DepthView]) -> list[Fit]:
    """The best tilted fit of each model whose size and hues can explain a group of points; none that sinks into the
    support."""
    points, support = part.points[sample(part.points)], float(np.median(part.support))
    hues, looked_at = hue_histogram(part.colours), points[sample(points, LOOKED_AT)]
    longest = float(np.ptp(points @ _principal(points), axis=0).max())
    camera_positions = np.array([view.camera.pose.position.array for view in views])
    found = []
    for name in sorted(library):
        surface = library[name]
        too_long = longest > np.linalg.norm(surface.model.shape.size) + SIDE_SLACK
        if too_long or surface.model.is_container or overlap(hues, surface.hues) < NO_HUES:
            continue
        fit = _fit(surface, points, looked_at, camera_positions)
        if (surface.points @ fit.rotation.T + fit.position)[:, 2].min() > support - SUNK:
            found.append(fit)
    return found


def _fit(surface: SurfaceModel, points: Array, looked_at: Array, camera_positions: Array) -> Fit:
    """The start that ends with most points near the surface, laid onto all points."""
    R, t = _starts(np.array(surface.model.shape.size), looked_at, camera_positions)
    for i in range(ROUNDS):
        R, t = _step(surface, looked_at, R, t, LOOSE * (TIGHT / LOOSE) ** (i / (ROUNDS - 1)))
    ended = surface_distances(surface, (looked_at[None] - t[:, None]) @ R)
    best = int(np.minimum(ended, WRONG).mean(axis=1).argmin())
    found = Fit(surface, TILTED, R[best], t[best], np.zeros(0))
    return Fit(surface, TILTED, R[best], t[best], found.surface_distance(points))


def _principal(points: Array) -> Array:
    """Principal axes of points (N, 3) as columns, each pointing up rather than down, shape (3, 3)."""
    flat = points - points.mean(axis=0)
    axes = np.linalg.eigh(flat.T @ flat)[1]
    return np.asarray(axes * np.where(axes[2] < 0, -1.0, 1.0))


def _starts(size: Array, points: Array, camera_positions: Array) -> tuple[Array, Array]:
    """Rotations (S, 3, 3) with the body's axis along each principal axis, turned about it, and positions (S, 3) at
    which the sides that face the cameras lie where the points end."""
    axes, rotations = _principal(points), []
    for k in range(3):
        up, side = axes[:, k], axes[:, (k + 1) % 3]
        upright = np.column_stack([side, np.cross(up, side), up])
        turns = Rotation.from_euler("z", [[180.0 * i / TURNS] for i in range(TURNS)], degrees=True).as_matrix()
        rotations.append(upright @ turns)
    R = np.concatenate(rotations)
    local, seen_from = points @ R, camera_positions.mean(axis=0) @ R
    low, high = local.min(axis=1), local.max(axis=1)
    facing = seen_from > (low + high) / 2
    centre = np.where(facing, high - size / 2, low + size / 2)
    return R, np.einsum("sij,sj->si", R, centre)


def _step(surface: SurfaceModel, points: Array, R: Array, t: Array, scale: float) -> tuple[Array, Array]:
    """One Gauss-Newton step of all starts at once."""
    arm = points[None] - t[:, None]
    local = arm @ R
    index = surface.lookup(local)
    offset, flat = local - surface.points[index], surface.normals[index]
    residual = np.einsum("sni,sni->sn", flat, offset)
    weight = 1.0 / (1.0 + np.einsum("sni,sni->sn", offset, offset) / scale**2) ** 2
    normal = flat @ R.transpose(0, 2, 1)
    J = np.concatenate([normal, np.cross(arm, normal)], axis=-1)  # of the residual by the body's motion, negated
    JW = (J * weight[..., None]).transpose(0, 2, 1)
    A, b = JW @ J, JW @ residual[..., None]
    A += np.diag([1e-6] * 3 + [TIGHT**2 / TURN_SIGMA**2] * 3)
    move = np.linalg.solve(A, b)[..., 0]
    turn = Rotation.from_rotvec(move[:, 3:]).as_matrix()
    return turn @ R, t + move[:, :3]
