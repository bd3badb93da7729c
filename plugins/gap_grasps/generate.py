"""From a cloud to ranked grasps: sample pairs, turn them into poses, drop those that do not fit, score the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gap_cli.contracts.failures import BadRequestError, PerceptionError
from gap_cli.contracts.robot import GripperSpec
from gap_cli.contracts.types import Array
from gap_grasps.clearance import above, clear_of, jaw_opening
from gap_grasps.sampling import antipodal_pairs, poses_around
from gap_grasps.scoring import score_poses
from gap_grasps.surface import Surface, closed_surface, seen_surface

MIN_POINTS = 30  # fewer do not show a surface
MAX_POINTS = 4000  # more add nothing at a pad's size and cost time
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
    if remove_outliers and len(points) > MIN_POINTS:
        points = points[_inliers(points)]
    if len(points) < MIN_POINTS:
        raise PerceptionError(
            "too_few_points", f"{len(points)} usable points do not show a surface to grasp; {MIN_POINTS} are needed."
        )
    if len(points) > MAX_POINTS:
        points = points[np.sort(rng.choice(len(points), MAX_POINTS, replace=False))]
    return seen_surface(points) if floor is None else closed_surface(points, floor)


def generate(
    surface: Surface,
    gripper: GripperSpec,
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
    pairs = antipodal_pairs(surface, 8 * count, gripper.max_width, rng)
    T, pair = poses_around(pairs, preferred)
    if len(T) > MAX_SCORED:
        keep = np.sort(rng.choice(len(T), MAX_SCORED, replace=False))
        T, pair = T[keep], pair[keep]
    opening = jaw_opening(pairs.width[pair], gripper)
    fits = np.ones(len(T), dtype=bool) if floor is None else above(floor, T, opening, gripper)
    around = surface.points if obstacles is None else np.concatenate([surface.points, obstacles])
    fits[fits] = clear_of(around, T[fits], opening[fits], gripper)
    T, pair = T[fits], pair[fits]
    scores = score_poses(surface, T, gripper) * (0.5 + 0.5 * (T[:, :3, 2] @ preferred))
    order = np.lexsort((np.arange(len(T)), -scores))[:count]
    order = order[scores[order] > 0]
    return Grasps(T[order], scores[order], pairs.first[pair[order]])


def _inliers(points: Array) -> Array:
    """Statistical outlier removal (Rusu 2008): mean distance to 8 neighbours within two deviations of the average."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=9)
    mean = distance[:, 1:].mean(axis=1)
    return np.asarray(mean <= mean.mean() + 2 * mean.std())
