"""The few statistics a rehearsal reports: a rate with its interval, and order statistics of durations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

Z95 = 1.959963984540054  # 97.5 % quantile of the standard normal distribution


class Rate(NamedTuple):
    """`passed` of `total`, and the 95 % interval of the underlying probability."""

    passed: int
    total: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The observed rate; 0 where nothing was observed."""
        return self.passed / self.total if self.total else 0.0

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.passed}/{self.total}), 95 % interval {self.low:.2f} to {self.high:.2f}"


def wilson(passed: int, total: int, z: float = Z95) -> Rate:
    """Wilson's score interval for a binomial proportion (E. B. Wilson, JASA 22, 1927, 209-212)."""
    if not 0 <= passed <= total:
        raise ValueError(f"{passed} of {total} is not a rate")
    if total == 0:
        return Rate(0, 0, 0.0, 1.0)
    p = passed / total
    scale = 1 + z * z / total
    centre = (p + z * z / (2 * total)) / scale
    half = z * math.sqrt(p * (1 - p) / total + z * z / (4 * total * total)) / scale
    return Rate(passed, total, max(0.0, min(p, centre - half)), min(1.0, max(p, centre + half)))


def quantile(values: Sequence[float], q: float) -> float | None:
    """The q-quantile by linear interpolation; None of nothing."""
    if not values:
        return None
    ordered = sorted(values)
    place = q * (len(ordered) - 1)
    below = math.floor(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])
