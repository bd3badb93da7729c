"""Assigns what stands on the supports to instances of the task's object models, each with a probability per model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gap_perception.scene.fit import Fit
from gap_perception.scene.interpenetration import interpenetrate
from gap_perception.scene.library import SurfaceModel
from gap_perception.scene.match import ModelMatch, evaluate_match
from gap_perception.scene.observed_points import GRID_TOLERANCE, ObservedPoints
from gap_perception.scene.propose import LYING, RAISED, STANDING, UPRIGHT, PoseHypothesis, propose, sample
from gap_perception.scene.split import split
from gap_perception.scene.tilt_fit import fit_tilted
from gap_perception.scene.visibility import DepthView
from gap_perception.scene.voxel_clusters import NeighbourGraph
from gap_runtime.contracts.types import Array

MIN_VOXELS = 12  # smaller groups are left-overs of edges, not objects
MIN_RAISED_VOXELS = 60  # an object that stands on no support must show
MIN_TILTED_VOXELS = 150  # and one that rests on none of its sides
SURE_VOXELS = 80  # from which a group shows enough to be sure of
ACCEPTED = -3.0  # log-likelihood from which a match is taken without looking further
UNKNOWN = -4.5  # log-likelihood of anything the task has no model of
PLAUSIBLE = 0.6  # share of points a model must explain to be considered at all


@dataclass(frozen=True)
class ObjectInstance:
    """One thing: the indices of its points, its best match if any, and the probability of being each named model."""

    voxels: Array
    match: ModelMatch | None
    scores: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str | None:
        """The most probable model, if any is more probable than nothing known."""
        best = max(self.scores, key=lambda n: self.scores[n], default=None)
        known = sum(self.scores.values())
        return best if best is not None and self.scores[best] > 1 - known else None

    @property
    def log_likelihood(self) -> float:
        """Of its best match."""
        return self.match.log_likelihood if self.match else -np.inf


def assign_instances(
    library: Mapping[str, SurfaceModel], points: ObservedPoints, views: Sequence[DepthView]
) -> list[ObjectInstance]:
    """Group the observed points and identify each group; groups that belong to one fitted model become one instance.

    Instances are ordered by decreasing number of points.
    """
    return _Assignment(library, points, views).instances()


def probabilities(matches: Sequence[ModelMatch], count: int) -> dict[str, float]:
    """Posterior over models and "none of them", flatter the fewer points there are to judge by."""
    trust = min(1.0, count / SURE_VOXELS)
    best: dict[str, float] = {}
    for match in matches:
        name = match.fit.surface.name
        best[name] = max(best.get(name, -np.inf), trust * match.log_likelihood)
    total = sum(np.exp(v) for v in best.values()) + np.exp(trust * UNKNOWN)
    return {name: float(np.exp(v) / total) for name, v in best.items()}


@dataclass(frozen=True)
class _Assignment:
    library: Mapping[str, SurfaceModel]
    points: ObservedPoints
    views: Sequence[DepthView]

    def instances(self) -> list[ObjectInstance]:
        graph, free = NeighbourGraph(self.points.points), np.arange(len(self.points.points))
        found: list[ObjectInstance] = []
        # From what is surest to what is least: the points that are assigned are no longer there for the others.
        for attempt in (self._upright, self._touching, self._lying, self._raised, self._tilted, self._uncertain):
            claims = attempt(_groups(graph, free))
            for claim in sorted(claims, key=lambda c: -c.log_likelihood):
                taken = self._claimed_points(claim, free)
                verified = self._verified(ObjectInstance(taken, claim.match, claim.scores))
                rivals = [] if verified is None else self._interpenetrating(verified, found)
                if verified is None or any(len(r.voxels) >= len(verified.voxels) for r in rivals):
                    continue
                found = [f for f in found if all(f is not r for r in rivals)] + [verified]
                free = np.setdiff1d(np.concatenate([free, *(r.voxels for r in rivals)]), taken)
        found = self._merged(found)
        found += [ObjectInstance(group, None) for group in _groups(graph, free)]
        return sorted(found, key=lambda i: -len(i.voxels))

    def _upright(self, groups: Sequence[Array]) -> list[ObjectInstance]:
        """Groups that are one upright object each."""
        return self._singles(groups, STANDING, ACCEPTED)

    def _touching(self, groups: Sequence[Array]) -> list[ObjectInstance]:
        """Objects partly hidden, and upright ones that touch each other."""
        return self._singles_or_splits(groups, UPRIGHT, UNKNOWN)

    def _lying(self, groups: Sequence[Array]) -> list[ObjectInstance]:
        """What has tipped over, alone or against others."""
        return self._singles_or_splits(groups, LYING, ACCEPTED)

    def _raised(self, groups: Sequence[Array]) -> list[ObjectInstance]:
        """Objects in or on others, or held; as less is known of where they can be, more of them must be seen."""
        return self._singles([g for g in groups if len(g) >= MIN_RAISED_VOXELS], RAISED, ACCEPTED)

    def _tilted(self, groups: Sequence[Array]) -> list[ObjectInstance]:
        """Objects that lean on others, at any tilt; the freest of all fits, so much must be seen and speak for them."""
        claims = []
        for group in (g for g in groups if len(g) >= MIN_TILTED_VOXELS):
            part = self.points.select(group)
            matches = self._plausible(fit_tilted(self.library, part, self.views), part)
            if matches and matches[0].log_likelihood > ACCEPTED:
                claims.append(ObjectInstance(group, matches[0], probabilities(matches, len(group))))
        return claims

    def _uncertain(self, groups: Sequence[Array]) -> list[ObjectInstance]:
        """What else a model explains better than nothing known does, once all that is sure has been taken away."""
        return self._singles(groups, LYING, UNKNOWN)

    def _singles(self, groups: Sequence[Array], hypothesis: PoseHypothesis, least: float) -> list[ObjectInstance]:
        """The groups that are one object with a log-likelihood above `least`."""
        claims = [self._single(group, hypothesis) for group in groups]
        return [c for c in claims if c is not None and c.log_likelihood > least]

    def _singles_or_splits(
        self, groups: Sequence[Array], hypothesis: PoseHypothesis, least: float
    ) -> list[ObjectInstance]:
        """Each group as one object, if that has a log-likelihood above `least`, or else as several."""
        claims = []
        for group in groups:
            single = self._single(group, hypothesis)
            if single is not None and single.log_likelihood > least:
                claims.append(single)
            else:
                parts = split(self.library, self.points.select(group), self.views, tipped=hypothesis.tipped)
                claims += [ObjectInstance(group[near], match) for near, match in parts]
        return claims

    def _single(self, group: Array, hypothesis: PoseHypothesis) -> ObjectInstance | None:
        """The group as one object, if any model is plausible."""
        matches = self._identify(group, hypothesis)
        return ObjectInstance(group, matches[0], probabilities(matches, len(group))) if matches else None

    def _identify(self, group: Array, hypothesis: PoseHypothesis) -> list[ModelMatch]:
        """Every plausible match for one group of points, best first."""
        part = self.points.select(group)
        return self._plausible(propose(self.library, part, hypothesis), part)

    def _plausible(self, fits: Sequence[Fit], part: ObservedPoints) -> list[ModelMatch]:
        """The plausible among fits to a `sample` of the group, evaluated, best first."""
        chosen = part.select(sample(part.points))
        near_enough = [f for f in fits if (f.distance < part.tolerance).mean() >= PLAUSIBLE]
        matches = [evaluate_match(f, chosen, self.views) for f in near_enough]
        return sorted(matches, key=lambda m: (-m.log_likelihood, m.fit.surface.name))

    def _claimed_points(self, claim: ObjectInstance, free: Array) -> Array:
        """The free points an instance stands for: all on its surface, and its own group where it explains most of
        it."""
        assert claim.match is not None
        fit, xyz, tolerance = claim.match.fit, self.points.points, self.points.tolerance
        around = free[fit.around(xyz[free], tolerance)]
        near = around[fit.surface_distance(xyz[around]) < tolerance]
        own = np.intersect1d(claim.voxels, free, assume_unique=True)
        return np.union1d(near, own) if claim.match.explained > 0.9 else near

    def _verified(self, claim: ObjectInstance) -> ObjectInstance | None:
        """The claim with probabilities, worked out from its points where it has none; None when they do not bear it
        out."""
        if len(claim.voxels) < MIN_VOXELS or claim.match is None:
            return None
        if claim.scores:
            return claim
        single = self._single(claim.voxels, UPRIGHT if claim.match.fit.rest == 0 else LYING)
        return None if single is None or single.log_likelihood < ACCEPTED else single

    def _interpenetrating(self, claim: ObjectInstance, found: Sequence[ObjectInstance]) -> list[ObjectInstance]:
        """Instances of other models that are where the claim says it is: of two such, what is less seen is no body,
        but left-overs of the other."""
        mine, blur = claim.match.fit if claim.match else None, self.points.tolerance - GRID_TOLERANCE
        fits = [(i, i.match.fit) for i in found if i.match is not None]
        return [i for i, f in fits if mine and f.surface is not mine.surface and interpenetrate(mine, f, blur)]

    def _merged(self, found: Sequence[ObjectInstance]) -> list[ObjectInstance]:
        """The instances, two that stand inside each other looked at again as one: a mug and, seen past it, its
        handle."""
        kept: list[ObjectInstance] = []
        for instance in found:
            place = next((i for i, k in enumerate(kept) if _same_place(k, instance)), None)
            if place is not None:
                whole = self._single(np.union1d(kept[place].voxels, instance.voxels), UPRIGHT)
                if whole and whole.log_likelihood > min(kept[place].log_likelihood, instance.log_likelihood):
                    kept[place] = whole
                    continue
            kept.append(instance)
        return kept


def _same_place(a: ObjectInstance, b: ObjectInstance) -> bool:
    """Two of one model, closer than any two of it can stand."""
    if a.match is None or b.match is None or a.match.fit.surface is not b.match.fit.surface:
        return False
    narrowest = min(a.match.fit.surface.model.shape.size[:2])
    return bool(np.linalg.norm(a.match.fit.position[:2] - b.match.fit.position[:2]) < narrowest / 2)


def _groups(graph: NeighbourGraph, free: Array) -> list[Array]:
    return [group for group in graph.clusters(free) if len(group) >= MIN_VOXELS]
