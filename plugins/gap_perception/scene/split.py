"""Takes touching objects apart: greedily, the model that explains most of a group without contradiction comes first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gap_perception.scene.colours import hue_histogram, overlap
from gap_perception.scene.fit import Fit, fits, resting_size, rests
from gap_perception.scene.library import SurfaceModel
from gap_perception.scene.match import ModelMatch, evaluate_match
from gap_perception.scene.observed_points import ObservedPoints
from gap_perception.scene.propose import TOP_SLACK, rectangle, sample
from gap_perception.scene.visibility import DepthView
from gap_runtime.contracts.types import Array

LOOKED_AT = 400  # points of the group that candidates are compared on
FITTED = 160  # of these, points that candidates are fitted to
FEWEST = 5  # of these, points from which a candidate is kept
ROUNDS = 7
ANCHORS = 10  # places a model is tried at
YAWS = 4
ENOUGH = 40  # points a model must explain to be believed among others
APART = 0.010  # m: candidates of one model nearer than this are one
SAME_HUES = 0.2  # overlap of hues below which a model cannot be part of the group
WORTH = -3.5  # log-likelihood of cameras and colour from which a part is accepted
MOST_PARTS = 8


def split(
    library: Mapping[str, SurfaceModel], part: ObservedPoints, views: Sequence[DepthView], *, tipped: bool
) -> list[tuple[Array, ModelMatch]]:
    """Models that together explain the group: for each the indices of the points on it, and the match."""
    if len(part.points) < ENOUGH:
        return []
    seen = part.select(sample(part.points, LOOKED_AT))
    pool = _pool(library, seen, tipped)
    if not pool:
        return []
    near = np.array([f.surface_distance(seen.points) < part.tolerance for f in pool])
    scale = len(part.points) / len(seen.points)
    rest, left = np.arange(len(part.points)), np.ones(len(seen.points), dtype=bool)
    found: list[tuple[Array, ModelMatch]] = []
    while len(rest) >= ENOUGH and len(found) < MOST_PARTS:
        match = _next(pool, near & left, scale, seen, views)
        if match is None:
            break
        taken = match.fit.surface_distance(part.points[rest]) < part.tolerance
        left &= ~(match.fit.surface_distance(seen.points) < part.tolerance)
        found.append((rest[taken], match))
        rest = rest[~taken]
    return found


def _next(
    pool: Sequence[Fit], near: Array, scale: float, seen: ObservedPoints, views: Sequence[DepthView]
) -> ModelMatch | None:
    """The believable candidate that explains most of the points still unexplained."""
    counts = near.sum(axis=1)
    for index in np.argsort(-counts, kind="stable"):
        if counts[index] * scale < ENOUGH:
            return None
        mine = seen.select(near[index])
        match = evaluate_match(pool[index], mine, views, near=np.ones(len(mine.points), dtype=bool))
        if match.log_likelihood > WORTH:
            return match
    return None


def _pool(library: Mapping[str, SurfaceModel], seen: ObservedPoints, tipped: bool) -> list[Fit]:
    """Fits of every model whose hues occur in the group, at every place it locks onto; no two alike."""
    hues = hue_histogram(seen.colours)
    fitted, support = seen.points[sample(seen.points, FITTED)], float(np.median(seen.support))
    pool: list[Fit] = []
    for name in sorted(library):
        surface = library[name]
        if overlap(hues, surface.hues) >= SAME_HUES:
            counted = [(int((f.distance < seen.tolerance).sum()), f) for f in _fits(surface, fitted, support, tipped)]
            pool += _distinct([f for n, f in sorted(counted, key=lambda c: -c[0]) if n >= FEWEST])
    return pool


def _distinct(candidates: Sequence[Fit]) -> list[Fit]:
    """The candidates, best first, none within `APART` of a better one that rests the same way."""
    kept: list[Fit] = []
    for candidate in candidates:
        if all(k.rest != candidate.rest or np.linalg.norm(k.position - candidate.position) > APART for k in kept):
            kept.append(candidate)
    return kept


def _fits(surface: SurfaceModel, points: Array, support: float, tipped: bool) -> list[Fit]:
    top = float(points[:, 2].max()) - support
    _, _, yaw = rectangle(points)
    places = _spread(points[:, :2], ANCHORS)
    found = []
    for rest in range(len(rests(surface.model.shape.kind)) if tipped else 1):
        if resting_size(surface, rest)[2] > top + TOP_SLACK:
            continue
        angles = [0.0] if surface.is_round and rest == 0 else [yaw + k * np.pi / YAWS for k in range(YAWS)]
        starts = np.array([(x, y, angle) for x, y in places for angle in angles])
        found += fits(surface, rest, points, starts, support, rounds=ROUNDS)
    return found


def _spread(points: Array, count: int) -> Array:
    """Farthest-point sampling of (N, 2), starting nearest to the middle."""
    first = int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))
    chosen = [first]
    distance = ((points - points[first]) ** 2).sum(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return points[chosen]
