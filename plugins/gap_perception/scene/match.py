"""Judges how well a fitted model explains a group of points: its shape, what the cameras see of it, its colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from gap_perception.scene.fit import Fit
from gap_perception.scene.library import SurfaceModel
from gap_perception.scene.observed_points import GRID_TOLERANCE, ObservedPoints
from gap_perception.scene.visibility import Agreement, DepthView, agreement
from gap_runtime.contracts.types import Array

ROUND_TURNS = 24
SAME_SHAPE = 0.95  # share of its points that must stay on a model turned about a symmetry
SQUARE = 0.004  # m: sides that differ by less look square
FAR_COLOUR = 60.0  # CIELAB distance from which colours are simply different
LIGHTNESS_WEIGHT = 0.5  # light and shadow change lightness far more than hue
# Log-likelihood units per unit of evidence; calibrated by `gap_perception.bench.perception` on development scenes.
UNEXPLAINED, SEEN_THROUGH, OFF_COLOUR = 12.0, 12.0, 0.25
HOPELESS = 6.0  # shape cost from which colours need not be looked at
USUAL_COLOUR = 8.0  # colour distance of a right match, from lighting and the grid
COLOUR_BLUR = 1100.0  # more of it per metre of tolerance: print that is looked up beside its place


@dataclass(frozen=True)
class ModelMatch:
    """A fitted model with its evidence: `explained` share of the points, cameras' `agreement`, `colour` distance and
    what that distance usually is for the right model seen by these sensors."""

    fit: Fit
    explained: float
    agreement: Agreement
    colour: float
    usual_colour: float = 0.0

    @property
    def log_likelihood(self) -> float:
        """Of the evidence under this model; 0 for a perfect match."""
        return -(self.shape_cost + OFF_COLOUR * max(self.colour - self.usual_colour, 0.0))

    @property
    def shape_cost(self) -> float:
        """What shape alone speaks against it, in units of log-likelihood."""
        return UNEXPLAINED * (1 - self.explained) + SEEN_THROUGH * (1 - self.agreement.share)


def evaluate_match(
    fit: Fit, part: ObservedPoints, views: Sequence[DepthView], *, near: Array | None = None
) -> ModelMatch:
    """Evidence for a fit from the measured points it was fitted to; the fit is turned to agree with their colours.

    `near` (N,) says which of them the model has to explain, if not all.
    """
    on_it = fit.distance < part.tolerance if near is None else near
    usual = USUAL_COLOUR + COLOUR_BLUR * (part.tolerance - GRID_TOLERANCE)
    unlikely = ModelMatch(fit, float(on_it.mean()), agreement(fit, views), FAR_COLOUR, usual)
    if unlikely.shape_cost > HOPELESS:  # whatever its colours
        return unlikely
    turned, colour = _turn(fit, part.select(on_it))
    return replace(unlikely, fit=turned, colour=colour)


def _turn(fit: Fit, part: ObservedPoints) -> tuple[Fit, float]:
    """The fit turned, among the turns its shape cannot tell apart, to where colours agree best."""
    turns = np.array([np.eye(3), *symmetries(fit.surface, standing=fit.rest == 0)])
    cost = colour_distances(fit, turns, part)
    for index in np.argsort(cost, kind="stable"):
        turned = replace(fit, rotation=fit.rotation @ turns[index])
        if index == 0 or _still_on(turned, part):
            return turned, float(cost[index])
    return fit, float(cost[0])


def _still_on(fit: Fit, part: ObservedPoints) -> bool:
    return float((fit.surface_distance(part.points) < part.tolerance).mean()) > SAME_SHAPE


def symmetries(surface: SurfaceModel, *, standing: bool) -> tuple[Array, ...]:
    """Turns, as rotations of the object's frame, that leave its outline about the same; upside down only when lying."""
    x, y, _ = surface.model.shape.size
    return _symmetries(ROUND_TURNS if surface.is_round else 4 if abs(x - y) < SQUARE else 2, standing)


@cache
def _symmetries(steps: int, standing: bool) -> tuple[Array, ...]:
    about_z = [Rotation.from_euler("z", 2 * np.pi * k / steps).as_matrix() for k in range(steps)]
    over = np.diag([1.0, -1.0, -1.0])
    return tuple(about_z[1:] if standing else about_z[1:] + [turn @ over for turn in about_z])


def colour_distances(fit: Fit, turns: Array, part: ObservedPoints) -> Array:
    """Mean CIELAB distance between measured colours and the model's at the same place, lightness level aside, for the
    fit turned by each of `turns` (T, 3, 3); shape (T,)."""
    local = fit.local(part.points) @ turns
    difference = part.colours - fit.surface.colours[fit.surface.lookup(local)]
    chroma = np.minimum(np.hypot(difference[..., 1], difference[..., 2]), FAR_COLOUR)
    level = np.median(difference[..., 0], axis=1, keepdims=True)
    lightness = np.minimum(np.abs(difference[..., 0] - level), FAR_COLOUR)
    return np.asarray(chroma.mean(axis=1) + LIGHTNESS_WEIGHT * lightness.mean(axis=1))
