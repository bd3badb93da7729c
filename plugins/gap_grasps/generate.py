"""From a cloud to ranked grasps: sample pairs, turn them into poses, drop those that do not fit, score the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gap_catalogue.shared.hand import Hand, above, clear_of
from gap_catalogue.shared.point_clouds import SURFACE, require_surface
from gap_grasps.sampling import antipodal_pairs, poses_around
from gap_grasps.scoring import score_poses
from gap_grasps.surface import Surface, closed_surface, seen_surface, thinned
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array

MAX_POINTS = 6000  # more add nothing at a pad's size and cost time
MAX_SCORED = 600  # poses that go through the collision and scoring stage


@dataclass(frozen=True)
class Grasps:
    """Ranked grasps: T_frame_tcp (K, 4, 4), scores (K,), one contact point of each (K, 3) [m]."""

    poses: Array
    scores: Array
    contacts: Array


def prepare(points: Array, floor: float | None, rng: np.random.Generator, *, remove_outliers: bool = True) -> Surface:
    """The surface to grasp. Raises `PerceptionError` (`too_few_points`) when the cloud shows none."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points):
        points = thinned(points)
    if remove_outliers and len(points) > SURFACE:
        points = points[_inliers(points)]
    require_surface(points)
    if len(points) > MAX_POINTS:
        points = points[np.sort(rng.choice(len(points), MAX_POINTS, replace=False))]
    return seen_surface(points) if floor is None else closed_surface(points, floor)


def generate(
    surface: Surface,
    hand: Hand,
    rng: np.random.Generator,
    *,
    count: int,
    preferred: Array,
    floor: float | None,
    obstacles: Array | None = None,
) -> Grasps:
    """Up to `count` grasps, best first; `preferred` (3,) is the approach direction poses lean to. May be empty."""
    if count < 1:
        raise BadRequestError("range", f"At least one grasp must be asked for, not {count}.")
    pairs = antipodal_pairs(surface, 4 * count, hand.gripper.max_width, preferred, rng)
    T, pair = poses_around(pairs, preferred, rng)
    if floor is not None:
        fits = above(floor, T, hand)
        T, pair = T[fits], pair[fits]
    if len(T) > MAX_SCORED:
        upright = np.maximum(T[:, :3, 2] @ preferred, 1e-3) ** 2
        keep = np.sort(rng.choice(len(T), MAX_SCORED, replace=False, p=upright / upright.sum()))
        T, pair = T[keep], pair[keep]
    around = surface.points if obstacles is None else np.concatenate([surface.points, obstacles])
    fits = clear_of(around, T, hand)
    T, pair = T[fits], pair[fits]
    scores = score_poses(surface, T, hand, floor, obstacles)
    # Among equals the more upright: wrist and forearm stay farther from what is grasped, and more arms reach there.
    order = np.lexsort((np.arange(len(T)), -T[:, :3, 2] @ preferred, -scores))[:count]
    order = order[scores[order] > 0]
    return Grasps(T[order], scores[order], pairs.first[pair[order]])


def _inliers(points: Array) -> Array:
    """Points whose mean distance to 8 neighbours is at most twice the median one. Twice: a rim's own is 1.5 times."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=9)
    mean = distance[:, 1:].mean(axis=1)
    return np.asarray(mean <= 2 * np.median(mean) + 1e-9)
