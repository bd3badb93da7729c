"""Does a score mean something? Success by score, how well scores tell successes from failures, with intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gap_runtime.contracts.types import Array

BINS = (0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 1.0)  # of scores; finer where the grasps are that anyone would take
RESAMPLES = 1000


class Bin(NamedTuple):
    """Grasps whose score is in [low, high): how many, their mean score, and their success with its interval."""

    low: float
    high: float
    n: int
    score: float
    success: float
    interval: tuple[float, float]

    @property
    def agrees(self) -> bool:
        """The mean score lies in the interval of the success rate."""
        return self.interval[0] <= self.score <= self.interval[1]


class Ranking(NamedTuple):
    """How well scores rank: area under the ROC curve with a 95 % interval that resamples whole scenes, Spearman's
    rank correlation with its p-value, and the mean distance of score and success over the bins."""

    n: int
    auc: float
    interval: tuple[float, float]
    spearman: float
    p: float
    calibration_error: float


def wilson(won: int, n: int) -> tuple[float, float]:
    """95 % interval of a rate (Wilson 1927)."""
    from scipy.stats import binomtest

    found = binomtest(won, n).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


def bins(rows: Iterable[Mapping[str, Any]]) -> list[Bin]:
    """Success by score, low scores first; bins without grasps are left out."""
    rows = list(rows)
    which = np.digitize([r["score"] for r in rows], BINS[1:-1])
    found = []
    for i, (low, high) in enumerate(pairwise(BINS)):
        mine = [r for r, k in zip(rows, which, strict=True) if k == i]
        if mine:
            won = sum(bool(r["success"]) for r in mine)
            mean = float(np.mean([r["score"] for r in mine]))
            found.append(Bin(low, high, len(mine), mean, won / len(mine), wilson(won, len(mine))))
    return found


def ranking(rows: Iterable[Mapping[str, Any]]) -> Ranking:
    """Of rows with "score", "success", "object" and "seed". Needs successes and failures, else NaN."""
    from scipy.stats import spearmanr

    rows = list(rows)
    scores, won = np.array([r["score"] for r in rows], float), np.array([bool(r["success"]) for r in rows])
    if won.all() or not won.any():
        return Ranking(len(rows), np.nan, (np.nan, np.nan), np.nan, np.nan, np.nan)
    _, scene = np.unique([f"{r['object']} {r['seed']}" for r in rows], return_inverse=True)
    members = [np.flatnonzero(scene == i) for i in range(scene.max() + 1)]
    rng = np.random.default_rng(0)
    resampled = []
    for _ in range(RESAMPLES):
        index = np.concatenate([members[i] for i in rng.integers(len(members), size=len(members))])
        resampled.append(auc(scores[index], won[index]))
    low, high = np.nanquantile(resampled, [0.025, 0.975])
    rank = spearmanr(scores, won)
    found = bins(rows)
    error = sum(b.n * abs(b.score - b.success) for b in found) / len(rows)
    return Ranking(
        len(rows), auc(scores, won), (float(low), float(high)), float(rank.statistic), float(rank.pvalue), error
    )


def auc(scores: Array, won: Array) -> float:
    """Chance that a success has the higher score than a failure, ties counting half (Mann and Whitney 1947)."""
    from scipy.stats import rankdata

    wins, losses = int(won.sum()), int((~won).sum())
    if not wins or not losses:
        return float("nan")
    return float((rankdata(scores)[won].sum() - wins * (wins + 1) / 2) / (wins * losses))
