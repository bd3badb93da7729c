"""Explains what stands on the supports as instances of the task's object models, each with a probability per model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gap_perception.scene.fit import Fit
from gap_perception.scene.interpenetration import collide
from gap_perception.scene.library import Appearance
from gap_perception.scene.match import Match, judge
from gap_perception.scene.observed_points import EXACT, Measured
from gap_perception.scene.propose import LYING, RAISED, STANDING, UPRIGHT, Stance, propose, sample
from gap_perception.scene.split import split
from gap_perception.scene.tilt_fit import lean
from gap_perception.scene.visibility import DepthView
from gap_perception.scene.voxel_clusters import Links
from gap_runtime.contracts.types import Array

SPECK = 12  # voxels: smaller groups are left-overs of edges, not objects
RAISED_WHOLE = 60  # voxels an object that stands on no support must show
LEANING_WHOLE = 150  # and one that rests on none of its sides
WHOLE = 80  # voxels from which a group shows enough to be sure of
GOOD = -3.0  # log-likelihood from which a match is taken without looking further
UNKNOWN = -4.5  # log-likelihood of anything the task has no model of
PLAUSIBLE = 0.6  # share of points a model must explain to be considered at all


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
    links, free = Links(scene.points), np.arange(len(scene.points))
    found: list[Instance] = []
    for attempt in (_standing, _touching, _lying, _raised, _leaning, _hardly):
        groups = _groups(links, free)
        claims = attempt(library, scene, groups, views)
        for instance in sorted(claims, key=lambda i: -_quality(i)):
            taken = _claim(scene, instance, free)
            judged = _judged(library, scene, Instance(taken, instance.match, instance.scores), views)
            rivals = [] if judged is None else _rivals(judged, found, scene.reach - EXACT)
            if judged is None or any(len(r.voxels) >= len(judged.voxels) for r in rivals):
                continue
            found = [f for f in found if all(f is not r for r in rivals)] + [judged]
            free = np.setdiff1d(np.concatenate([free, *(r.voxels for r in rivals)]), taken)
    found = _joined(library, scene, found, views)
    found += [Instance(group, None) for group in _groups(links, free)]
    return sorted(found, key=lambda i: -len(i.voxels))


def _rivals(claim: Instance, found: Sequence[Instance], blur: float) -> list[Instance]:
    """Instances of other models that are where the claim says it is: of two such, what is less seen is no body, but
    left-overs of the other."""
    mine = claim.match.fit if claim.match else None
    fits = [(i, i.match.fit) for i in found if i.match is not None]
    return [i for i, f in fits if mine and f.appearance is not mine.appearance and collide(mine, f, blur)]


def _joined(
    library: Mapping[str, Appearance], scene: Measured, found: Sequence[Instance], views: Sequence[DepthView]
) -> list[Instance]:
    """The instances, two that stand inside each other looked at again as one: a mug and, seen past it, its handle."""
    kept: list[Instance] = []
    for instance in found:
        place = next((i for i, k in enumerate(kept) if _overlap(k, instance)), None)
        if place is not None:
            both = np.union1d(kept[place].voxels, instance.voxels)
            whole = _single(library, scene, both, views, UPRIGHT)
            if whole is not None and _quality(whole) > min(_quality(kept[place]), _quality(instance)):
                kept[place] = whole
                continue
        kept.append(instance)
    return kept


def _overlap(a: Instance, b: Instance) -> bool:
    """Two of one model, closer than any two of it can stand."""
    if a.match is None or b.match is None or a.match.fit.appearance is not b.match.fit.appearance:
        return False
    narrowest = min(a.match.fit.appearance.model.shape.size[:2])
    return bool(np.linalg.norm(a.match.fit.position[:2] - b.match.fit.position[:2]) < narrowest / 2)


def _groups(links: Links, free: Array) -> list[Array]:
    return [group for group in links.groups(free) if len(group) >= SPECK]


def identify(
    library: Mapping[str, Appearance], part: Measured, views: Sequence[DepthView], stance: Stance
) -> list[Match]:
    """Every plausible match for one group of points, best first."""
    return _judge_all(propose(library, part, stance), part, views)


def _judge_all(fits: Sequence[Fit], part: Measured, views: Sequence[DepthView]) -> list[Match]:
    """The plausible among fits to a `sample` of the group, judged, best first."""
    chosen = part.select(sample(part.points))
    matches = [judge(f, chosen, views) for f in fits if (f.distance < part.reach).mean() >= PLAUSIBLE]
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


def _standing(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """Groups that are one upright object each."""
    return [
        claim
        for group in groups
        if (claim := _single(library, scene, group, views, STANDING)) is not None and _quality(claim) > GOOD
    ]


def _touching(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """Objects partly hidden, and upright ones that touch each other."""
    return _one_or_more(library, scene, groups, views, UPRIGHT, UNKNOWN)


def _lying(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """What has tipped over, alone or against others."""
    return _one_or_more(library, scene, groups, views, LYING, GOOD)


def _hardly(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """What else a model explains better than nothing known does, once all that is sure has been taken away."""
    claims = [_single(library, scene, group, views, LYING) for group in groups]
    return [c for c in claims if c is not None and _quality(c) > UNKNOWN]


def _one_or_more(
    library: Mapping[str, Appearance],
    scene: Measured,
    groups: Sequence[Array],
    views: Sequence[DepthView],
    stance: Stance,
    least: float,
) -> list[Instance]:
    """Each group as one object, if that has a log-likelihood of at least `least`, or else as several."""
    claims = []
    for group in groups:
        single = _single(library, scene, group, views, stance)
        if single is not None and _quality(single) > least:
            claims.append(single)
        else:
            parts = split(library, scene.select(group), views, tipped=stance.tipped)
            claims += [Instance(group[near], match) for near, match in parts]
    return claims


def _raised(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """Objects in or on others, or held; as less is known of where they can be, more of them must be seen."""
    large = [g for g in groups if len(g) >= RAISED_WHOLE]
    claims = [_single(library, scene, group, views, RAISED) for group in large]
    return [c for c in claims if c is not None and _quality(c) > GOOD]


def _leaning(
    library: Mapping[str, Appearance], scene: Measured, groups: Sequence[Array], views: Sequence[DepthView]
) -> list[Instance]:
    """Objects that lean on others, at any tilt; the freest of all fits, so much must be seen and speak for them."""
    claims = []
    for group in (g for g in groups if len(g) >= LEANING_WHOLE):
        part = scene.select(group)
        matches = _judge_all(lean(library, part, views), part, views)
        if matches and matches[0].log_likelihood > GOOD:
            claims.append(Instance(group, matches[0], probabilities(matches, len(group))))
    return claims


def _single(
    library: Mapping[str, Appearance], scene: Measured, group: Array, views: Sequence[DepthView], stance: Stance
) -> Instance | None:
    """The group as one object, if any model is plausible."""
    matches = identify(library, scene.select(group), views, stance)
    return Instance(group, matches[0], probabilities(matches, len(group))) if matches else None


def _quality(instance: Instance) -> float:
    return instance.match.log_likelihood if instance.match else -np.inf


def _claim(scene: Measured, instance: Instance, free: Array) -> Array:
    """The free points an instance stands for: all on its surface, and its own group where it explains most of it."""
    assert instance.match is not None
    fit = instance.match.fit
    around = free[fit.around(scene.points[free], scene.reach)]
    near = around[fit.surface_distance(scene.points[around]) < scene.reach]
    own = np.intersect1d(instance.voxels, free, assume_unique=True)
    if instance.match.explained > 0.9:
        near = np.union1d(near, own)
    return near


def _judged(
    library: Mapping[str, Appearance], scene: Measured, claim: Instance, views: Sequence[DepthView]
) -> Instance | None:
    """The claim with probabilities, worked out from its points where it has none; None when they do not bear it out."""
    if len(claim.voxels) < SPECK or claim.match is None:
        return None
    if claim.scores:
        return claim
    stance = UPRIGHT if claim.match.fit.rest == 0 else LYING
    matches = identify(library, scene.select(claim.voxels), views, stance)
    if not matches or matches[0].log_likelihood < GOOD:
        return None
    return Instance(claim.voxels, matches[0], probabilities(matches, len(claim.voxels)))
