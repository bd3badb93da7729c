"""Judges how well a fitted model explains a group of points: its shape, what the cameras see of it, its colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.contracts.types import Array
from gap_perception.scene.fit import Fit, resting_size
from gap_perception.scene.visibility import Agreement, DepthView, agreement

ON_SURFACE = 0.004  # m: a point this near to a model is explained by it
ROUND_TURNS = 24
SQUARE = 0.004  # m: sides that differ by less look square
FAR_COLOUR = 60.0  # CIELAB distance from which colours are simply different
LIGHTNESS_WEIGHT = 0.5  # light and shadow change lightness far more than hue
# Log-likelihood units per unit of evidence; calibrated by `gap_perception.bench` on development scenes.
UNEXPLAINED, SEEN_THROUGH, OFF_COLOUR = 12.0, 12.0, 0.25
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
        return -(
            UNEXPLAINED * (1 - self.explained)
            + SEEN_THROUGH * (1 - self.agreement.share)
            + OFF_COLOUR * max(self.colour - USUAL_COLOUR, 0.0)
        )


def judge(fit: Fit, points: Array, colours: Array, views: Sequence[DepthView], *, near: Array | None = None) -> Match:
    """Evidence for a fit from world points (N, 3) with CIELAB colours (N, 3); the fit is turned to agree with them."""
    near = fit.distance < ON_SURFACE if near is None else near
    seen = agreement(fit, views)
    if not near.any():
        return Match(fit, 0.0, seen, FAR_COLOUR)
    turned, colour = _turn(fit, points[near], colours[near])
    return Match(turned, float(near.mean()), seen, colour)


def _turn(fit: Fit, points: Array, colours: Array) -> tuple[Fit, float]:
    """The turn about the vertical, among those the shape cannot tell apart, under which colours agree best."""
    best, cost = fit, np.inf
    for angle in _turns(fit):
        rotation = Rotation.from_euler("z", angle).as_matrix() @ fit.rotation
        candidate = fit if angle == 0 else replace(fit, rotation=rotation)
        value = colour_distance(candidate, points, colours)
        if value < cost - 1e-9:
            best, cost = candidate, value
    return best, float(cost)


def _turns(fit: Fit) -> Array:
    if fit.appearance.is_round and fit.rest == 0:
        return np.arange(ROUND_TURNS) * (2 * np.pi / ROUND_TURNS)
    size = resting_size(fit.appearance, fit.rest)
    count = 4 if abs(size[0] - size[1]) < SQUARE else 2
    return np.arange(count) * (2 * np.pi / count)


def colour_distance(fit: Fit, points: Array, colours: Array) -> float:
    """Mean CIELAB distance between measured colours and the model's at the same place, lightness level aside."""
    model = fit.appearance.colours[fit.appearance.lookup(fit.local(points))]
    difference = colours - model
    chroma = np.minimum(np.hypot(difference[:, 1], difference[:, 2]), FAR_COLOUR)
    lightness = np.minimum(np.abs(difference[:, 0] - np.median(difference[:, 0])), FAR_COLOUR)
    return float(chroma.mean() + LIGHTNESS_WEIGHT * lightness.mean())
