"""Judges how well a fitted model explains a group of points: its shape, what the cameras see of it, its colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.contracts.types import Array
from gap_perception.scene.fit import Fit
from gap_perception.scene.library import Appearance
from gap_perception.scene.visibility import Agreement, DepthView, agreement

ON_SURFACE = 0.004  # m: a point this near to a model is explained by it
ROUND_TURNS = 24
SAME_SHAPE = 0.95  # share of its points that must stay on a model turned about a symmetry
SQUARE = 0.004  # m: sides that differ by less look square
FAR_COLOUR = 60.0  # CIELAB distance from which colours are simply different
LIGHTNESS_WEIGHT = 0.5  # light and shadow change lightness far more than hue
# Log-likelihood units per unit of evidence; calibrated by `gap_perception.bench` on development scenes.
UNEXPLAINED, SEEN_THROUGH, OFF_COLOUR = 12.0, 12.0, 0.25
HOPELESS = 6.0  # shape cost from which colours need not be looked at
USUAL_COLOUR = 8.0  # colour distance of a right match, from lighting and the grid


@dataclass(frozen=True)
class Match:
    """A fitted model with its evidence: `explained` share of the points, cameras' `agreement`, `colour` distance."""

    fit: Fit
    explained: float
    agreement: Agreement
    colour: float

    @property
    def log_likelihood(self) -> float:
        """Of the evidence under this model; 0 for a perfect match."""
        return -(self.shape_cost + OFF_COLOUR * max(self.colour - USUAL_COLOUR, 0.0))

    @property
    def shape_cost(self) -> float:
        """What shape alone speaks against it, in units of log-likelihood."""
        return UNEXPLAINED * (1 - self.explained) + SEEN_THROUGH * (1 - self.agreement.share)


def judge(fit: Fit, points: Array, colours: Array, views: Sequence[DepthView], *, near: Array | None = None) -> Match:
    """Evidence for a fit from world points (N, 3) with CIELAB colours (N, 3); the fit is turned to agree with them."""
    near = fit.distance < ON_SURFACE if near is None else near
    seen = agreement(fit, views)
    unlikely = Match(fit, float(near.mean()), seen, FAR_COLOUR)
    if unlikely.shape_cost > HOPELESS:  # whatever its colours
        return unlikely
    turned, colour = _turn(fit, points[near], colours[near])
    return replace(unlikely, fit=turned, colour=colour)


def _turn(fit: Fit, points: Array, colours: Array) -> tuple[Fit, float]:
    """The fit turned, among the turns its shape cannot tell apart, to where colours agree best."""
    best, cost = fit, colour_distance(fit, points, colours)
    for turn in symmetries(fit.appearance, standing=fit.rest == 0):
        candidate = replace(fit, rotation=fit.rotation @ turn)
        value = colour_distance(candidate, points, colours)
        if value < cost - 1e-9 and _still_on(candidate, points):
            best, cost = candidate, value
    return best, cost


def _still_on(fit: Fit, points: Array) -> bool:
    return float((fit.surface_distance(points) < ON_SURFACE).mean()) > SAME_SHAPE


def symmetries(appearance: Appearance, *, standing: bool) -> list[Array]:
    """Turns, as rotations of the object's frame, that leave its outline about the same; upside down only when lying."""
    x, y, _ = appearance.model.shape.size
    steps = ROUND_TURNS if appearance.is_round else 4 if abs(x - y) < SQUARE else 2
    about_z = [Rotation.from_euler("z", 2 * np.pi * k / steps).as_matrix() for k in range(steps)]
    over = np.diag([1.0, -1.0, -1.0])
    return about_z[1:] if standing else about_z[1:] + [turn @ over for turn in about_z]


def colour_distance(fit: Fit, points: Array, colours: Array) -> float:
    """Mean CIELAB distance between measured colours and the model's at the same place, lightness level aside."""
    model = fit.appearance.colours[fit.appearance.lookup(fit.local(points))]
    difference = colours - model
    chroma = np.minimum(np.hypot(difference[:, 1], difference[:, 2]), FAR_COLOUR)
    lightness = np.minimum(np.abs(difference[:, 0] - np.median(difference[:, 0])), FAR_COLOUR)
    return float(chroma.mean() + LIGHTNESS_WEIGHT * lightness.mean())
