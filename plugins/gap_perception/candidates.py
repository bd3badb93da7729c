"""The segments of an image that a phrase can mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gap_runtime.contracts.types import Array, BoundingBox2D


@dataclass(frozen=True)
class Candidate:
    """One segment of an image: its `mask` (H, W), `box` (x_min, y_min, x_max, y_max; max exclusive), and `scores`, the
    probability of being each named model. With depth also its median `depth` [m], `center` in the world (3,) [m], and
    `size` of its points in the world (3,) [m]."""

    mask: Array
    box: tuple[int, int, int, int]
    scores: Mapping[str, float]
    depth: float = float("nan")
    center: Array | None = None
    size: Array = field(default_factory=lambda: np.zeros(3))
    instance: int = -1

    @property
    def bounds(self) -> BoundingBox2D:
        """The box as the contract writes it."""
        return BoundingBox2D(*(float(v) for v in self.box))

    def score(self, names: Mapping[str, float]) -> float:
        """Probability that it is one of the models, each weighed by how sure the phrase means it."""
        most = max(names.values(), default=1.0)
        return float(min(1.0, sum(sure / most * self.scores.get(name, 0.0) for name, sure in names.items())))


def box_of(mask: Array) -> tuple[int, int, int, int]:
    """Smallest box around a non-empty mask (x_min, y_min, x_max, y_max; max exclusive)."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
