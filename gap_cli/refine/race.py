"""Races one candidate against the incumbent on the same instances, in blocks, until it has won or can no longer win."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from gap_cli.refine.statistics import Level, Paired, Row, blocks, can_still_win

FASTER = 0.99  # a median motion time above this share of the incumbent's is no gain worth a change
SUCCESS_SHARE = 0.8  # of a test's level that goes to success; the rest goes to speed, whose differences are plain
HARMED = 2  # seeds a candidate may lose, net, before a block ends the race for speed alone
Evaluate = Callable[[Sequence[int]], Mapping[int, Row]]
Outcome = Literal["better", "faster", "dropped", "not_better"]


@dataclass(frozen=True)
class Verdict:
    """How a race ended: `better` (more instances solved) and `faster` (none lost, less motion time) are accepted.

    `level` is the error level its test was made at, `reason` says in a sentence why.
    """

    outcome: Outcome
    paired: Paired
    rows: Mapping[int, Row]
    level: float
    reason: str

    @property
    def accepted(self) -> bool:
        """True where the candidate replaces the incumbent."""
        return self.outcome in ("better", "faster")


def race(seeds: Sequence[int], incumbent: Mapping[int, Row], evaluate: Evaluate, level: Level) -> Verdict:
    """Roll a candidate out on the incumbent's seeds, most informative first, and test once, on all of them.

    A candidate that can win neither by success nor by speed any more is dropped after the block that showed it; its
    test counts as made. Identical rows are no change, and not accepted.
    """
    rows: dict[int, Row] = {}
    for block in blocks(seeds, incumbent):
        rows |= evaluate(block)
        paired = Paired.of(incumbent, rows)
        left = sum(not incumbent[s]["success"] for s in seeds if s not in rows)
        slower = len(paired.lost) - len(paired.gained) >= HARMED or (len(paired.ratios) >= 5 and paired.time_ratio > 1)
        if not can_still_win(paired, left, SUCCESS_SHARE * level.now) and slower:
            return Verdict("dropped", paired, rows, level.use(False), _reason(paired, "it can no longer win"))
    return _judge(Paired.of(incumbent, rows), rows, level)


def _judge(paired: Paired, rows: Mapping[int, Row], level: Level) -> Verdict:
    """Success first; speed only where nothing was lost. One test, at one level, however it is won."""
    success_level, time_level = SUCCESS_SHARE * level.now, (1 - SUCCESS_SHARE) * level.now
    if paired.success_p <= success_level:
        return Verdict("better", paired, rows, level.use(True), _reason(paired, f"p = {paired.success_p:.4f}"))
    kept = len(paired.lost) <= len(paired.gained)
    if kept and paired.time_ratio <= FASTER and paired.time_p <= time_level:
        return Verdict("faster", paired, rows, level.use(True), _reason(paired, f"p = {paired.time_p:.4f}"))
    why = f"p = {paired.success_p:.3f} > {success_level:.4f} for success"
    return Verdict("not_better", paired, rows, level.use(False), _reason(paired, why))


def _reason(paired: Paired, why: str) -> str:
    time = f", motion time x{paired.time_ratio:.3f}" if paired.ratios else ""
    return f"{len(paired.gained)} instances gained, {len(paired.lost)} lost{time}: {why}"
