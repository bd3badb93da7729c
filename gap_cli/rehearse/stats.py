"""The few statistics a rehearsal reports: a rate with its interval, and the spread of durations."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np


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


def wilson(passed: int, total: int) -> Rate:
    """The rate with Wilson's score interval (E. B. Wilson, JASA 22, 1927, 209-212). Raises ValueError for no rate."""
    from scipy.stats import binomtest  # half a second: only who reports a rate waits for it

    if total == 0 and passed == 0:
        return Rate(0, 0, 0.0, 1.0)
    interval = binomtest(passed, total).proportion_ci(confidence_level=0.95, method="wilson")
    return Rate(passed, total, float(interval.low), float(interval.high))


def spread(values: Iterable[float]) -> dict[str, float | None]:
    """Median, 90 % quantile and maximum, None of nothing."""
    found = np.array(list(values))
    names = {"median": 0.5, "p90": 0.9, "max": 1.0}
    return {name: float(np.quantile(found, q)) if found.size else None for name, q in names.items()}
