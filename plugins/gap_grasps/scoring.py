"""How good is a grasp? The chance that it succeeds when the hand misses its place by the declared error."""

from __future__ import annotations

import numpy as np

from gap_catalogue.shared.hand import Hand
from gap_grasps.calibration import fitted
from gap_grasps.robustness import misplacement_robustness
from gap_grasps.surface import Surface
from gap_runtime.contracts.types import Array

DIGITS = 2  # of a score: smaller differences are below what the measures' misplacements resolve


def score_poses(
    surface: Surface, T_tcp: Array, hand: Hand, floor: float | None, obstacles: Array | None = None
) -> Array:
    """Score in [0, 1] of each pose (K,): its measures (see `robustness.Measures`) through the fitted calibration.

    The arm's reach is no part of it. A pose that would hold nothing scores 0.
    """
    if not len(T_tcp):
        return np.zeros(0)
    return np.round(fitted().chance(misplacement_robustness(surface, T_tcp, hand, floor, obstacles)), DIGITS)
