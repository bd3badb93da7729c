"""Takes touching objects apart: greedily, the model that explains most of a group without contradiction comes first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gap_cli.contracts.types import Array
from gap_perception.scene.fit import Fit, fit, resting_size, rests
from gap_perception.scene.library import Appearance
from gap_perception.scene.match import OFF_COLOUR, ON_SURFACE, SEEN_THROUGH, USUAL_COLOUR, Match, judge
from gap_perception.scene.propose import SAMPLE, TOP_SLACK, rectangle, sample
from gap_perception.scene.visibility import DepthView

if TYPE_CHECKING:
    from gap_perception.scene.explain import Measured

ANCHORS = 10  # places a model is tried at
YAWS = 4
ENOUGH = 40  # points a model must explain to be believed among others
WORTH = -3.5  # log-likelihood of cameras and colour from which a part is accepted
MOST_PARTS = 8


def split(library: Mapping[str, Appearance], part: Measured, views: Sequence[DepthView]) -> list[tuple[Array, Match]]:
    """Models that together explain the group: for each the indices of the points on it, and the match."""
    rest = np.arange(len(part.points))
    found: list[tuple[Array, Match]] = []
    while len(rest) >= ENOUGH and len(found) < MOST_PARTS:
        best = _largest(library, part.select(rest), views)
        if best is None:
            break
        near = best.fit.surface_distance(part.points[rest]) < ON_SURFACE
        if near.sum() < ENOUGH:
            break
        found.append((rest[near], best))
        rest = rest[~near]
    return found


def _largest(library: Mapping[str, Appearance], part: Measured, views: Sequence[DepthView]) -> Match | None:
    """The believable match that explains most points."""
    chosen = sample(part.points, SAMPLE)
    points, colours = part.points[chosen], part.colours[chosen]
    support = float(np.median(part.support))
    best, most = None, ENOUGH * len(chosen) / len(part.points)
    for name in sorted(library):
        for candidate in _fits(library[name], points, support):
            explained = float((candidate.distance < ON_SURFACE).sum())
            if explained <= most:
                continue
            match = judge(candidate, points, colours, views)
            if _worth(match) > WORTH:
                best, most = match, explained
    return best


def _worth(match: Match) -> float:
    return -SEEN_THROUGH * (1 - match.agreement.share) - OFF_COLOUR * max(match.colour - USUAL_COLOUR, 0.0)


def _fits(surface: Appearance, points: Array, support: float) -> list[Fit]:
    top = float(points[:, 2].max()) - support
    _, _, yaw = rectangle(points)
    fits = []
    for rest in range(len(rests(surface.model.shape.kind))):
        if resting_size(surface, rest)[2] > top + TOP_SLACK:
            continue
        angles = [0.0] if surface.is_round and rest == 0 else [yaw + k * np.pi / YAWS for k in range(YAWS)]
        places = _spread(points[:, :2], ANCHORS)
        starts = np.array([(x, y, angle) for x, y in places for angle in angles])
        fits.append(fit(surface, rest, points, starts, support))
    return fits


def _spread(points: Array, count: int) -> Array:
    """Farthest-point sampling of (N, 2), starting nearest to the middle."""
    first = int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))
    chosen = [first]
    distance = ((points - points[first]) ** 2).sum(axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return points[chosen]
