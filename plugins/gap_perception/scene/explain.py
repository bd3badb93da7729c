"""Explains what stands on the supports as instances of the task's object models, each with a probability per model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gap_cli.contracts.types import Array
from gap_perception.scene.blobs import components
from gap_perception.scene.library import Appearance
from gap_perception.scene.match import ON_SURFACE, Match, judge
from gap_perception.scene.propose import propose, sample
from gap_perception.scene.split import split
from gap_perception.scene.visibility import DepthView

SPECK = 12  # voxels: smaller groups are left-overs of edges, not objects
WHOLE = 80  # voxels from which a group shows enough to be sure of
GOOD = -3.0  # log-likelihood from which a match is taken without looking further
UNKNOWN = -4.5  # log-likelihood of anything the task has no model of
PLAUSIBLE = 0.6  # share of points a model must explain to be considered at all


@dataclass(frozen=True)
class Measured:
    """All cameras' points above the supports on a grid: `points` (M, 3) [m], CIELAB `colours` (M, 3), height of the
    `support` below each (M,) [m]."""

    points: Array
    colours: Array
    support: Array

    def select(self, index: Array) -> Measured:
        """The points at `index`."""
        return Measured(self.points[index], self.colours[index], self.support[index])


@dataclass(frozen=True)
class Instance:
    """One thing: the indices of its points, its best match if any, and the probability of being each named model."""

    voxels: Array
    match: Match | None
    scores: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str | None:
        """The most probable model, if any is more probable than nothing known."""
        best = max(self.scores, key=lambda n: self.scores[n], default=None)
        known = sum(self.scores.values())
        return best if best is not None and self.scores[best] > 1 - known else None


def explain(library: Mapping[str, Appearance], scene: Measured, views: Sequence[DepthView]) -> list[Instance]:
    """Group the measured points and identify each group; groups that belong to one fitted model become one instance.

    Instances are ordered by decreasing number of points.
    """
    free = np.arange(len(scene.points))
    found: list[Instance] = []
    for attempt in (_stand_alone, _hidden_or_touching):
        groups = _groups(scene, free)
        claims = attempt(library, scene, groups, views)
        for instance in sorted(claims, key=lambda i: -_quality(i)):
            taken = _claim(scene, instance, free, groups)
            if len(taken) >= SPECK:
                found.append(_rescored(library, scene, Instance(taken, instance.match, instance.scores), views))
                free = np.setdiff1d(free, taken, assume_unique=True)
    found += [Instance(group, None) for group in _groups(scene, free)]
    return sorted(found, key=lambda i: -len(i.voxels))


def _groups(scene: Measured, free: Array) -> list[Array]:
    labels = components(scene.points[free])
    groups = [free[labels == label] for label in range(int(labels.max(initial=-1)) + 1)]
    return [g for g in groups if len(g) >= SPECK]


def identify(
    library: Mapping[str, Appearance], part: Measured, views: Sequence[DepthView], *, whole: bool, upright: bool = False
) -> list[Match]:
    """Every plausible match for one group of points, best first; `whole` and `upright` as in `propose`."""
    chosen = sample(part.points)
    support = float(np.median(part.support))
    fits = propose(library, part.points, support, whole=whole, upright=upright)
    fits = [f for f in fits if (f.distance < ON_SURFACE).mean() >= PLAUSIBLE]
    matches = [judge(f, part.points[chosen], part.colours[chosen], views) for f in fits]
    return sorted(matches, key=lambda m: (-m.log_likelihood, m.fit.appearance.name))


def probabilities(matches: Sequence[Match], count: int) -> dict[str, float]:
    """Posterior over models and "none of them", flatter the fewer points there are to judge by."""
    trust = min(1.0, count / WHOLE)
    best: dict[str, float] = {}
    for match in matches:
        name = match.fit.appearance.name
        best[name] = max(best.get(name, -np.inf), trust * match.log_likelihood)
    total = sum(np.exp(v) for v in best.values()) + np.exp(trust * UNKNOWN)
    return {name: float(np.exp(v) / total) for name, v in best.items()}


def _stand_alone(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """Groups that are one upright object each."""
    claims = []
    for group in groups:
        matches = identify(library, scene.select(group), views, whole=True)
        if matches and matches[0].log_likelihood > GOOD:
            claims.append(Instance(group, matches[0], probabilities(matches, len(group))))
    return claims


def _hidden_or_touching(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """What is left: objects partly hidden or tipped over, then several objects that touch."""
    claims = []
    for group in groups:
        matches = identify(library, scene.select(group), views, whole=False)
        if matches and matches[0].log_likelihood > UNKNOWN:
            claims.append(Instance(group, matches[0], probabilities(matches, len(group))))
            continue
        part = scene.select(group)
        claims += [Instance(group[near], match) for near, match in split(library, part, views)]
    return claims


def _quality(instance: Instance) -> float:
    return instance.match.log_likelihood if instance.match else -np.inf


def _claim(scene: Measured, instance: Instance, free: Array, groups: Sequence[Array]) -> Array:
    """The free points an instance stands for: all on its surface, and its own group where it explains most of it."""
    assert instance.match is not None
    near = free[instance.match.fit.surface_distance(scene.points[free]) < ON_SURFACE]
    own = np.intersect1d(instance.voxels, free, assume_unique=True)
    if instance.match.explained > 0.9:
        near = np.union1d(near, own)
    return near


def _rescored(
    library: Mapping[str, Appearance], scene: Measured, instance: Instance, views: Sequence[DepthView]
) -> Instance:
    """The instance with probabilities, where it was found without any."""
    if instance.scores or instance.match is None:
        return instance
    part = scene.select(instance.voxels)
    matches = identify(library, part, views, whole=False, upright=instance.match.fit.rest == 0)
    if not matches:
        return instance
    return Instance(instance.voxels, matches[0], probabilities(matches, len(instance.voxels)))
