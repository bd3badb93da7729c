"""Paired tests between two graphs on the same instances, and how the error level of a run is spent over its tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Paired:
    """Two graphs on the same instances. `gained` are seeds that only the candidate solved, `lost` those that only the
    incumbent did; `ratios` are candidate over incumbent motion time where both succeeded."""

    gained: tuple[int, ...]
    lost: tuple[int, ...]
    ratios: tuple[float, ...]

    @classmethod
    def of(cls, incumbent: Mapping[int, Row], candidate: Mapping[int, Row]) -> Paired:
        """Compare rows by seed, on the seeds that both have."""
        seeds = sorted(incumbent.keys() & candidate.keys())
        both = [s for s in seeds if incumbent[s]["success"] and candidate[s]["success"]]
        return cls(
            tuple(s for s in seeds if candidate[s]["success"] and not incumbent[s]["success"]),
            tuple(s for s in seeds if incumbent[s]["success"] and not candidate[s]["success"]),
            tuple(candidate[s]["motion_s"] / incumbent[s]["motion_s"] for s in both),
        )

    @property
    def success_p(self) -> float:
        """One-sided p that the candidate is better: McNemar's test on the discordant pairs, mid-p
        (M. W. Fagerland et al., BMC Medical Research Methodology 13:91, 2013)."""
        return midp(len(self.gained), len(self.lost))

    @property
    def time_p(self) -> float:
        """One-sided p that the candidate is faster where both succeed: Wilcoxon's signed-rank test; 1 without data."""
        from scipy.stats import wilcoxon

        shifts = np.log(np.array(self.ratios))
        if not len(shifts) or not (np.abs(shifts) > 1e-9).any():
            return 1.0
        return float(wilcoxon(shifts, alternative="less", zero_method="zsplit").pvalue)

    @property
    def time_ratio(self) -> float:
        """Median of candidate over incumbent motion time; 1 without data."""
        return float(np.median(self.ratios)) if self.ratios else 1.0


def midp(gained: int, lost: int) -> float:
    """One-sided mid-p of `gained` against `lost` discordant pairs under equal chances; 1 when there are none."""
    from scipy.stats import binom

    pairs = gained + lost
    if not pairs:
        return 1.0
    return float(binom.sf(gained, pairs, 0.5) + 0.5 * binom.pmf(gained, pairs, 0.5))


@dataclass
class Level:
    """The error level `alpha` of a run, spent test by test so that over all of them a change that is no better is
    accepted with probability `alpha` at most: the fallback procedure (B. L. Wiens, Pharmaceutical Statistics 2, 2003,
    211-215). Each of `tests` gets an equal share; the level of an accepted test passes to the next."""

    alpha: float
    tests: int
    spent: list[float] = field(default_factory=list)
    _carried: float = 0.0

    @property
    def now(self) -> float:
        """The level of the next test; 0 when all tests were made."""
        return self.alpha / self.tests + self._carried if len(self.spent) < self.tests else 0.0

    def use(self, accepted: bool) -> float:
        """Make one test at `now`; returns the level it was made at."""
        level = self.now
        self.spent.append(level)
        self._carried = level if accepted else 0.0
        return level


def can_still_win(paired: Paired, left: int, level: float) -> bool:
    """Whether the success test could reach `level` if the candidate gained every one of the `left` instances."""
    return midp(len(paired.gained) + left, len(paired.lost)) <= level


def blocks(seeds: Sequence[int], incumbent: Mapping[int, Row], size: int = 10) -> list[list[int]]:
    """The seeds in blocks, most informative first: what the incumbent failed and, by turns, what it solved, so that
    the first block shows both what a candidate gains and what it breaks."""
    failed = [s for s in seeds if not incumbent[s]["success"]]
    solved = [s for s in seeds if incumbent[s]["success"]]
    mixed: list[int] = []
    while failed or solved:
        mixed += [pool.pop(0) for pool in (failed, failed, solved) if pool]
    return [mixed[i : i + size] for i in range(0, len(mixed), size)]
