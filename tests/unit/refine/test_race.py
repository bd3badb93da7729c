"""Races: what is better is accepted, what is not is not, at the level the run was given."""

from __future__ import annotations

import numpy as np
import pytest

from gap_cli.refine.race import race
from gap_cli.refine.statistics import Level, Paired, blocks, midp


def rows(success, motion=None):
    motion = np.full(len(success), 5.0) if motion is None else motion
    return {
        s: {"seed": s, "success": bool(ok), "motion_s": float(t)}
        for s, (ok, t) in enumerate(zip(success, motion, strict=True))
    }


def run(incumbent, candidate, alpha=0.05, tests=1):
    level = Level(alpha, tests)
    seeds = sorted(incumbent)
    return race(seeds, incumbent, lambda block: {s: candidate[s] for s in block}, level), level


def test_midp_is_half_of_what_is_just_as_extreme():
    assert midp(4, 0) == pytest.approx(1 / 32)
    assert midp(0, 0) == 1.0
    assert midp(3, 5) > 0.5 > midp(5, 3)


def test_a_graph_is_no_better_than_itself():
    same = rows(np.arange(30) % 3 > 0, np.linspace(4, 6, 30))
    verdict, _ = run(same, same)
    assert not verdict.accepted and verdict.paired.success_p == verdict.paired.time_p == 1.0


@pytest.mark.parametrize("rate", [0.5, 0.9])
def test_two_equal_graphs_with_luck_of_their_own_are_told_apart_in_at_most_one_run_of_twenty(rate):
    rng = np.random.default_rng(0)
    wins = 0
    for _ in range(400):
        draws, times = rng.random((2, 60)) < rate, rng.lognormal(1.5, 0.1, (2, 60))
        wins += run(rows(draws[0], times[0]), rows(draws[1], times[1]))[0].accepted
    assert wins <= 400 * 0.05 + 2 * np.sqrt(400 * 0.05 * 0.95)


def test_ten_points_more_are_seen_on_sixty_instances():
    rng = np.random.default_rng(1)
    wins = 0
    for _ in range(200):
        before = rng.random(60) < 0.8
        fixed = rng.random(60) < 0.10 / 0.2  # ten points of the twenty that failed
        wins += run(rows(before), rows(before | fixed))[0].accepted
    assert wins >= 160


def test_what_keeps_success_and_is_faster_is_accepted_and_what_loses_is_not():
    before = rows(np.ones(30), np.linspace(4, 6, 30))
    fast = np.linspace(4, 6, 30) * 0.9
    assert run(before, rows(np.ones(30), fast))[0].outcome == "faster"
    broken = np.ones(30)
    broken[:3] = 0
    assert not run(before, rows(broken, fast))[0].accepted


def test_a_hopeless_candidate_is_dropped_early():
    before = rows(np.arange(60) % 2)
    asked = []

    def evaluate(block):
        asked.extend(block)
        return {s: {"seed": s, "success": False, "motion_s": 5.0} for s in block}

    verdict = race(sorted(before), before, evaluate, Level(0.05, 1))
    assert verdict.outcome == "dropped" and len(asked) < 60


def test_blocks_show_gains_and_losses_early_and_hold_every_seed_once():
    before = rows(np.arange(30) >= 6)
    first, *rest = blocks(range(30), before)
    assert {s for s in first if not before[s]["success"]} == set(range(6)) and len(first) == 10
    assert sorted(s for block in [first, *rest] for s in block) == list(range(30))


def test_the_level_is_spent_over_the_tests_and_carried_on_by_a_win():
    level = Level(0.05, 10)
    assert level.use(False) == pytest.approx(0.005)
    assert level.use(True) == pytest.approx(0.005)
    assert level.use(True) == pytest.approx(0.010)
    for _ in range(7):
        level.use(False)
    assert level.now == 0.0 and sum(level.spent) <= 0.05 + 0.015


def test_pairs_are_compared_on_what_both_were_rolled_out_on():
    paired = Paired.of(rows([1, 0, 1]), {1: rows([1, 1])[1], 2: rows([1, 1, 0])[2]})
    assert paired.gained == (1,) and paired.lost == (2,) and paired.ratios == ()
