"""Antipodal pairs on a surface, and the grasp poses around each (ten Pas and Platt 2015; Mahler et al. 2017)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from gap_grasps.surface import Surface
from gap_runtime.contracts.types import Array

FRICTION = 0.5  # coefficient a pair must hold with: rubber pads on cardboard or tin, on the careful side
LINE_RADIUS = 0.004  # m: how far from the closing line the opposite contact may lie
THINNEST = 0.002  # m between contacts
APPROACHES = 12  # approach directions tried around each closing line
SLIDE = 0.007  # m the pads may be pushed along the approach, past the contacts or short of them


@dataclass(frozen=True)
class Pairs:
    """Contacts (M, 3) on either side and the inward friction angle of the worse one, as a margin in [0, 1] (M,)."""

    first: Array
    second: Array
    margin: Array

    @property
    def width(self) -> Array:
        """Distance between the contacts [m], shape (M,)."""
        return np.asarray(np.linalg.norm(self.second - self.first, axis=1))


def antipodal_pairs(
    surface: Surface, count: int, max_width: float, preferred: Array, rng: np.random.Generator
) -> Pairs:
    """Up to `count` pairs whose closing line lies inside both friction cones (Nguyen 1988), no wider than `max_width`.

    From a random point, rather one that faces across the `preferred` approach (3,), the line runs against its normal,
    turned a little inside the cone; of the surface points near that line that face away along it, one is drawn.
    """
    sideways = np.sqrt(np.maximum(1 - (surface.normals @ preferred) ** 2, 0.0)) ** 2 + 1e-3
    start = rng.choice(len(surface.points), size=count, p=sideways / sideways.sum())
    direction = -surface.normals[start] + rng.normal(0, FRICTION / 3, (count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    steps = np.arange(LINE_RADIUS, max_width + LINE_RADIUS, LINE_RADIUS)
    probes = surface.points[start][:, None] + steps[None, :, None] * direction[:, None]
    tree = cKDTree(surface.points)
    distance, nearest = tree.query(probes.reshape(-1, 3), k=2, distance_upper_bound=LINE_RADIUS)
    hit = np.isfinite(distance).reshape(count, -1)
    nearest = np.where(hit, nearest.reshape(count, -1), 0)
    facing = np.einsum("nkj,nj->nk", surface.normals[nearest], direction)
    chance = np.where(hit & (facing > 1 / np.hypot(1, FRICTION)), rng.random(hit.shape), -1.0)
    other = nearest[np.arange(count), np.argmax(chance, axis=1)]
    found = (chance.max(axis=1) >= 0) & (other != start)
    return _in_cones(surface, start[found], other[found], max_width)


def _in_cones(surface: Surface, one: Array, two: Array, max_width: float) -> Pairs:
    first, second = surface.points[one], surface.points[two]
    line = second - first
    width = np.linalg.norm(line, axis=1)
    line = line / np.maximum(width, 1e-9)[:, None]
    cosine = np.minimum(
        np.einsum("ni,ni->n", -surface.normals[one], line), np.einsum("ni,ni->n", surface.normals[two], line)
    )
    margin = cone_margin(cosine)
    keep = (margin > 0) & (width <= max_width) & (width > THINNEST)
    return Pairs(first[keep], second[keep], margin[keep])


def cone_margin(cosine: Array) -> Array:
    """1 where the closing line runs along the normal, 0 at the edge of the friction cone and beyond."""
    angle = np.arccos(np.clip(cosine, -1, 1))
    return np.asarray(np.clip(1 - angle / np.arctan(FRICTION), 0, 1))


def poses_around(pairs: Pairs, preferred: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """T (K, 4, 4) of TCPs centred between the contacts, y along the closing line, and the pair each belongs to (K,).

    The nearest approach to `preferred` (3,) and others around it, none more than 90 degrees away, each pushed along
    itself by up to `SLIDE`.
    """
    closing = (pairs.second - pairs.first) / np.maximum(pairs.width, 1e-9)[:, None]
    across = np.cross(closing, preferred)
    flat = np.linalg.norm(across, axis=1) < 1e-6
    across[flat] = np.cross(closing[flat], [1.0, 0.0, 0.0])
    across[flat & (np.linalg.norm(across, axis=1) < 1e-6)] = [0.0, 1.0, 0.0]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    base = np.cross(across, closing)  # the approach nearest to the preferred one
    angles = np.pi * np.arange(-APPROACHES // 2 + 1, APPROACHES // 2) / APPROACHES
    approach = np.cos(angles)[None, :, None] * base[:, None] + np.sin(angles)[None, :, None] * across[:, None]
    index = np.repeat(np.arange(len(closing)), len(angles))
    z, y = approach.reshape(-1, 3), closing[index]
    T = np.tile(np.eye(4), (len(index), 1, 1))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = np.cross(y, z), y, z
    T[:, :3, 3] = ((pairs.first + pairs.second) / 2)[index] + rng.uniform(-SLIDE, SLIDE, (len(index), 1)) * z
    keep = z @ preferred > 0
    return T[keep], index[keep]
