"""The grasp benchmark's rows as tables: success by object and generator, and by score, against the goals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from gap_grasps.bench.execution import GENERATORS, VOID, was_tried
from gap_grasps.bench.grasps import DRAWN
from gap_grasps.bench.objects import EXTRAS, HANDLE, LIES, STANDS
from gap_grasps.pose_error import DECLARED
from gap_grasps.reliability import bins, ranking, wilson
from gap_runtime.contracts.bench import BenchReport, Picture, Table

GOAL = 0.97  # of groceries
PACKAGES = ("mujoco", "scipy", "opencv-python-headless")
Row = Mapping[str, Any]


def report(rows: Iterable[Row], first: int, pictures: tuple[Picture, ...] = ()) -> BenchReport:
    """One table of success by object and generator, one of success by score; `first` is the first seed."""
    rows = list(rows)
    best = [row for row in rows if row["generator"] != DRAWN]
    drawn = [row for row in rows if row["generator"] == DRAWN]
    tried = [row for row in drawn if was_tried(row)]
    spent = {g: [r["ms"] for r in best if r["generator"] == g and r["ms"] is not None] for g in GENERATORS}
    notes = (
        "Success: lifted more than 0.10 m and still between both fingers after holding for 1 s and two strokes of 4 cm "
        "to the sides, judged by the simulator's truth. A grasp that no arm motion reaches is a failure, and so is "
        f"one in whose course physics diverged: {sum(row['reason'] == VOID for row in best)} of {len(best)}.",
        "Each object alone, anywhere in reach, at any yaw; half of the groceries and boxes lie, on any side they can "
        f"lie on. Wilson 95 % intervals; n in brackets. Seeds from {first} on.",
        f"By score: grasps drawn evenly over the scores, sampled ones and blind ones alike, by a hand that misses its "
        f"place by {1000 * DECLARED.position:g} mm along and {DECLARED.rotation_deg:g} degrees about each axis "
        "(standard deviations). Left out, as the arm never came to the grasp: "
        f"{len(drawn) - len(tried)} of {len(drawn)}, those whose physics diverged among them.",
        "Median processor time per call, rendering left out: "
        + ", ".join(f"{g} {np.median(ms):.0f} ms" for g, ms in spent.items() if ms)
        + ".",
    )
    return BenchReport(
        "Grasps executed in physics", ("object", *GENERATORS, "goal"), tuple(_by_object(best)), notes, PACKAGES,
        more=(Table("Success by score", ("score", "n", "mean score", "success", "goal"), tuple(_by_score(tried))),),
        pictures=pictures,
    )  # fmt: skip


def _by_object(rows: list[Row]) -> list[tuple[Any, ...]]:
    groceries = [row for row in rows if row["object"] not in {*EXTRAS, HANDLE}]
    table = [("groceries", *_rates(groceries), _verdict(groceries))]
    for rest in (STANDS, LIES):
        table.append((f"groceries {rest}", *_rates([r for r in groceries if r["rest"] == rest]), ""))
    for name in dict.fromkeys(row["object"] for row in rows):
        table.append((name.replace("_", " "), *_rates([r for r in rows if r["object"] == name]), ""))
    return table


def _rates(rows: list[Row]) -> list[str]:
    return [rate([bool(r["success"]) for r in rows if r["generator"] == g]) for g in GENERATORS]


def _verdict(rows: list[Row]) -> str:
    """Which generators reach the goal, by what was measured."""
    won = {g: [bool(r["success"]) for r in rows if r["generator"] == g] for g in GENERATORS}
    met = [g for g, w in won.items() if w and sum(w) / len(w) >= GOAL]
    missed = [g for g, w in won.items() if w and g not in met]
    parts = [f"met by {', '.join(met)}" if met else "", f"missed by {', '.join(missed)}" if missed else ""]
    return f">= {GOAL:g}: " + "; ".join(p for p in parts if p) if met or missed else ""


def _by_score(tried: list[Row]) -> list[tuple[Any, ...]]:
    """A row per bin, then how well scores rank."""
    table: list[tuple[Any, ...]] = [
        (
            f"{b.low:.1f}-{b.high:.1f}", b.n, round(b.score, 3), _interval(b.success, b.interval),
            "score in the interval: " + ("yes" if b.agrees else "no"),
        )
        for b in bins(tried)
    ]  # fmt: skip
    rank = ranking(tried)
    if math.isnan(rank.auc):
        return table
    above = "yes" if rank.interval[0] > 0.5 else "no"
    rising = "yes" if rank.spearman > 0 and rank.p < 0.01 else "no"
    return [
        *table,
        ("area under the ROC curve", rank.n, "", _interval(rank.auc, rank.interval), f"interval above 0.5: {above}"),
        ("Spearman's rank correlation", rank.n, "", f"{rank.spearman:.3f} (p = {rank.p:.1g})", f"p < 0.01: {rising}"),
        ("distance of score and success", rank.n, "", f"{rank.calibration_error:.3f}", ""),
    ]


def rate(won: list[bool]) -> str:
    """Share of successes with its interval and count; '' for none."""
    if not won:
        return ""
    return f"{_interval(sum(won) / len(won), wilson(sum(won), len(won)))} ({len(won)})"


def _interval(value: float, interval: tuple[float, float]) -> str:
    return f"{value:.3f} [{interval[0]:.3f}, {interval[1]:.3f}]"
