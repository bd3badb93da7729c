"""What the measures of a grasp are worth together: a map to the chance that it succeeds, fitted in physics."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from gap_grasps.robustness import Measures
from gap_runtime.contracts.types import Array

FILE = Path(__file__).with_name("calibration.json")


@dataclass(frozen=True)
class Calibration:
    """log-odds of success = `intercept` + sum of `weights` times the measures (logistic regression).

    No weight is negative, so a better measure never lowers a score.
    """

    intercept: float
    weights: Mapping[str, float]

    def chance(self, measures: Measures) -> Array:
        """Chance of success (K,) of each grasp; 0 where no misplacement of the hand would hold anything."""
        weights = np.array([self.weights[name] for name in Measures._fields])
        odds = self.intercept + np.stack(measures, axis=1) @ weights
        return np.asarray(np.where(measures.closure > 0, 1 / (1 + np.exp(-odds)), 0.0))


@lru_cache(maxsize=1)
def fitted() -> Calibration:
    """The calibration that comes with the plugin; the file says how it was made."""
    data: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return Calibration(data["intercept"], data["weights"])
