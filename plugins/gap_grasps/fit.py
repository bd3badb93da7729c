"""Fits the map from a grasp's measures to its chance of success, in physics, on development seeds.

`python -m gap_grasps.fit` writes `calibration.json`, with what it was made from and how good it is.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from gap_catalogue.shared.hand import Hand
from gap_grasps.bench.execution import Ranked, Seen, was_tried
from gap_grasps.bench.run import UNSHARED, Job, Row, jobs, measured, rows_of
from gap_grasps.bench.sampling import pool_of
from gap_grasps.calibration import FILE
from gap_grasps.generate import prepare
from gap_grasps.pose_error import DECLARED
from gap_grasps.reliability import auc, bins, ranking
from gap_grasps.robustness import Measures, measure
from gap_grasps.support import support_below
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.types import Array, Se3Pose

SCHEMA = "gap/grasp-calibration/v1"
RIDGE = 0.1  # strength of the pull of weights towards 0
DIGITS = 4


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, fit, write."""
    parser = argparse.ArgumentParser(prog="python -m gap_grasps.fit", description=__doc__)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=24, help="per object")
    parser.add_argument("--draws", type=int, default=6, help="grasps per scene")
    options = parser.parse_args(arguments)
    seeds = range(options.first_seed, options.first_seed + options.scenes)
    if seeds.stop > 10_000:
        parser.error("Seeds from 10000 on are kept for reporting; fit on smaller ones.")
    work = jobs(seeds, (), options.draws)
    rows = measured(work, _progress, fit_rows)
    data = calibration_of(rows)
    data["command"] = (
        f"python -m gap_grasps.fit --first-seed {options.first_seed} --scenes {options.scenes} --draws {options.draws}"
    )
    FILE.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def _progress(done: float, name: str) -> None:
    sys.stderr.write(f"{done:4.0%} {name}\n")


def fit_rows(job: Job) -> list[Row]:
    """Drawn grasps of one job with their measures."""
    name, seeds, generators, draws = job
    found = []
    for row in rows_of(name, seeds, generators, draws, unweighted_pool):
        if was_tried(row):
            (measures,) = np.stack(_measures(row["cell"], row["seen"], [row["pose"]]), axis=1)
            found.append({k: v for k, v in row.items() if k not in UNSHARED} | {"measures": measures})
    return found


def unweighted_pool(cell: StandaloneContext, seen: Seen) -> Ranked:
    """The pool with the product of the measures for a score, so that no earlier fit has a say in what is drawn."""
    ranked = pool_of(cell, seen)
    worth = np.prod(np.stack(_measures(cell, seen, [pose for pose, _ in ranked])), axis=0) if ranked else []
    return [(pose, float(w)) for (pose, _), w in zip(ranked, worth, strict=True)]


def _measures(cell: StandaloneContext, seen: Seen, poses: Sequence[Se3Pose]) -> Measures:
    rng = np.random.default_rng([cell.seed, len(seen.target)])
    floor = support_below(cell, seen.target)
    T = np.array([pose.matrix for pose in poses]).reshape(-1, 4, 4)
    return measure(prepare(seen.target, floor, rng), T, Hand.of(cell.robot()), floor)


def calibration_of(rows: list[Row]) -> dict[str, Any]:
    """The fit and its account: how many grasps, how it ranks objects it was not fitted on, success by score."""
    x = np.stack([row["measures"] for row in rows])
    won = np.array([bool(row["success"]) for row in rows])
    names = np.array([row["object"] for row in rows])
    held_out = np.zeros(len(rows))
    for name in dict.fromkeys(names):
        held_out[names == name] = chance(logistic(x[names != name], won[names != name]), x[names == name])
    fit = logistic(x, won)
    unseen = [{**row, "score": score} for row, score in zip(rows, held_out, strict=True)]
    rank = ranking(unseen)
    return {
        "schema": SCHEMA,
        "intercept": round(float(fit[0]), DIGITS),
        "weights": {name: round(float(w), DIGITS) for name, w in zip(Measures._fields, fit[1:], strict=True)},
        "error": {"position_m": DECLARED.position, "rotation_deg": DECLARED.rotation_deg},
        "grasps": len(rows),
        "successes": int(won.sum()),
        "seeds": [min(row["seed"] for row in rows), max(row["seed"] for row in rows)],
        "each_object_left_out": {
            "auc": round(rank.auc, 3),
            "auc_interval": [round(v, 3) for v in rank.interval],
            "spearman": round(rank.spearman, 3),
            "calibration_error": round(rank.calibration_error, 3),
            "bins": [[b.low, b.high, b.n, round(b.score, 3), round(b.success, 3)] for b in bins(unseen)],
        },
        "auc_of_each_measure": {
            name: round(auc(x[:, i], won), 3) for i, name in enumerate(Measures._fields)
        },
    }  # fmt: skip


def logistic(x: Array, won: Array) -> Array:
    """Intercept and non-negative weights (1 + F,) of a ridge-regularised logistic regression of `won` (N,) on x."""
    from scipy.optimize import minimize

    sign = np.where(won, 1.0, -1.0)

    def loss(w: Array) -> tuple[float, Array]:
        margin = sign * (w[0] + x @ w[1:])
        pull = -sign / (1 + np.exp(margin))
        gradient = np.concatenate([[pull.sum()], x.T @ pull + 2 * RIDGE * w[1:]])
        return float(np.logaddexp(0, -margin).sum() + RIDGE * (w[1:] ** 2).sum()), gradient

    bounds = [(None, None), *[(0, None)] * x.shape[1]]
    return np.asarray(minimize(loss, np.zeros(1 + x.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B").x)


def chance(fit: Array, x: Array) -> Array:
    """What `Calibration.chance` says of measures x (N, F)."""
    return np.asarray(1 / (1 + np.exp(-fit[0] - x @ fit[1:])))


if __name__ == "__main__":
    main()
