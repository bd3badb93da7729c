"""Lays an object model onto measured points: point-to-plane ICP for a body that rests on a known support.

Method: Chen and Medioni, Object modelling by registration of multiple range images, 1992, with Geman-McClure weights;
the search is over x, y, yaw, and a height held near the resting one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from gap_perception.scene.library import SurfaceModel
from gap_runtime.contracts.types import Array

ITERATIONS = 8
FINE = 3  # of the iterations, the last, that look at all points; those before look at every other
LOOSE, TIGHT = 0.015, 0.002  # m: scale of the robust weights, from the first iteration to the last
WRONG = 0.008  # m: farther points are not explained at all, however far
SUNK = 0.008  # m: a fit whose lowest point is farther below the support is no pose at all
FREE_SIGMA = 0.05  # m: of the height of something held
HEIGHT_SIGMA = 0.002  # m: calibration error and compliance; the support's height is known
TURN_SIGMA = 0.3  # rad per iteration, damping for round bodies whose yaw the points do not determine


@dataclass(frozen=True)
class Fit:
    """A model at T_world_object = (`rotation` (3, 3), `position` (3,) [m]), resting as `rest` says.

    `distance` (N,) [m] is how far each point it was fitted to lies from the model's surface.
    """

    surface: SurfaceModel
    rest: int
    rotation: Array
    position: Array
    distance: Array

    def local(self, points: Array) -> Array:
        """World points (N, 3) in the object's frame."""
        return np.asarray((points - self.position) @ self.rotation)

    def around(self, points: Array, margin: float) -> Array:
        """True for world points (N, 3) within `margin` [m] of the smallest sphere around the model, shape (N,)."""
        offset = points - self.position
        reach = float(np.linalg.norm(self.surface.model.shape.size)) / 2 + margin
        return np.asarray(_dot(offset, offset) < reach**2)

    def surface_distance(self, points: Array) -> Array:
        """Distance of world points (N, 3) from the model's surface, shape (N,) [m]."""
        return surface_distances(self.surface, self.local(points))


@cache
def rests(kind: str) -> tuple[Array, ...]:
    """Rotations R_level_object of the poses an object can rest in, standing first."""
    if kind == "open_box":
        turns: list[list[float]] = [[0, 0, 0]]
    elif kind == "cylinder":
        turns = [[0, 0, 0], [90, 0, 0]]
    else:
        turns = [[0, 0, 0], [90, 0, 0], [0, 90, 0], [-90, 0, 0], [0, -90, 0]]
    return tuple(Rotation.from_euler("xyz", turn, degrees=True).as_matrix() for turn in turns)


def resting_size(surface: SurfaceModel, rest: int) -> Array:
    """Extents along level axes of the object resting that way, shape (3,) [m]."""
    return np.asarray(np.abs(rests(surface.model.shape.kind)[rest]) @ np.array(surface.model.shape.size))


def fit(surface: SurfaceModel, rest: int, points: Array, starts: Array, support: float, *, free: bool = False) -> Fit:
    """The best of `fits`: the one with the most points near its surface."""
    found = fits(surface, rest, points, starts, support, free=free)
    return min(found, key=lambda f: float(np.minimum(f.distance, WRONG).mean()))


def fits(
    surface: SurfaceModel,
    rest: int,
    points: Array,
    starts: Array,
    support: float,
    *,
    free: bool = False,
    rounds: int = ITERATIONS,
) -> list[Fit]:
    """One fit to world points (N, 3) from each of the `starts` (S, 3) of x, y [m] and yaw [rad], after `rounds` steps.

    `support` is the height of the surface below; with `free` the object may hang at any height.
    """
    base = rests(surface.model.shape.kind)[rest]
    half = resting_size(surface, rest)[2] / 2
    height, sigma = (float(points[:, 2].max()) - half, FREE_SIGMA) if free else (support + half, HEIGHT_SIGMA)
    state = np.column_stack([starts[:, :2], np.full(len(starts), height), starts[:, 2]])
    for i in range(rounds):
        scale = LOOSE * (TIGHT / LOOSE) ** (i / (rounds - 1))
        looked_at = points if i >= rounds - FINE else points[::2]
        state = state + _step(surface, base, looked_at, state, scale, (height, sigma))
    R, t = _pose(base, state)
    distance = surface_distances(surface, (points[None] - t[:, None]) @ R)
    return [Fit(surface, rest, R[s], t[s], distance[s]) for s in range(len(starts))]


def _pose(base: Array, state: Array) -> tuple[Array, Array]:
    c, s = np.cos(state[:, 3]), np.sin(state[:, 3])
    turn = np.zeros((len(state), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    return turn @ base, state[:, :3]


def _step(
    surface: SurfaceModel, base: Array, points: Array, state: Array, scale: float, height: tuple[float, float]
) -> Array:
    """One Gauss-Newton step of all starts at once, shape (S, 4)."""
    R, t = _pose(base, state)
    arm = points[None] - t[:, None]
    local = arm @ R
    index = surface.lookup(local)
    offset = local - surface.points[index]
    flat = surface.normals[index]
    residual = _dot(flat, offset)
    weight = 1.0 / (1.0 + _dot(offset, offset) / scale**2) ** 2
    normal = flat @ R.transpose(0, 2, 1)
    yaw = normal[..., 1] * arm[..., 0] - normal[..., 0] * arm[..., 1]
    J = np.concatenate([normal, yaw[..., None]], axis=-1)  # of the residual by (point moved with the body), negated
    JW = (J * weight[..., None]).transpose(0, 2, 1)
    A, b = JW @ J, (JW @ residual[..., None])[..., 0]
    noise = TIGHT**2
    A[:, 2, 2] += noise / height[1] ** 2
    b[:, 2] += noise / height[1] ** 2 * (height[0] - state[:, 2])
    A += np.diag([1e-6, 1e-6, 1e-6, noise / TURN_SIGMA**2])
    return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])


def surface_distances(surface: SurfaceModel, local: Array) -> Array:
    """Distance of points (..., 3) in the object's frame from the model's surface, shape (...) [m]: along the normal
    where the nearest surface point is near, else to that point."""
    index = surface.lookup(local)
    offset = local - surface.points[index]
    normal = np.abs(_dot(surface.normals[index], offset))
    sideways = np.sqrt(np.maximum(_dot(offset, offset) - normal**2, 0.0))
    return np.asarray(np.hypot(normal, np.maximum(sideways - 0.004, 0.0)))


def signed_depth(surface: SurfaceModel, local: Array) -> Array:
    """How far points (..., 3) in the object's frame lie behind its surface, shape (...) [m]; negative outside."""
    index = surface.lookup(local)
    return -_dot(surface.normals[index], local - surface.points[index])


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", a, b))
