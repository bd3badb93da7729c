"""`gap bench grasp-calibration`: fits the map from a grasp's measures to its chance of success, in physics.

`python -m gap_grasps.fit docs/results/grasp-calibration.json` takes such a result over into `calibration.json`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gap_catalogue.shared.hand import Hand
from gap_grasps.bench.execution import Ranked, SeenObject, was_tried
from gap_grasps.bench.run import HELD_OUT, UNSHARED, GraspJob, Row, jobs, measured, rows_of
from gap_grasps.bench.sampling import pool_of
from gap_grasps.calibration import FILE
from gap_grasps.generate import prepare
from gap_grasps.pose_error import DECLARED
from gap_grasps.reliability import Bin, auc, bins, ranking
from gap_grasps.robustness import Measures, misplacement_robustness
from gap_grasps.support import support_below
from gap_runtime.contracts.bench import BenchContext, BenchReport, Table
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.types import Array, Se3Pose

SCHEMA = "gap/grasp-calibration/v1"
RIDGE = 0.1  # strength of the pull of weights towards 0
DIGITS = 4
SCENES, DRAWS = 24, 6  # per object, and grasps per scene


def run(bench: BenchContext) -> BenchReport:
    """Measure and fit on development seeds. Raises `BadRequestError` for seeds that are kept for reporting."""
    first = bench.seed or 0
    seeds = range(first, first + (bench.n or SCENES))
    if seeds.stop > HELD_OUT:
        raise BadRequestError("range", f"Seeds from {HELD_OUT} on are kept for reporting; fit on smaller ones.")
    rows = measured(bench, jobs(bench, seeds, (), DRAWS), fit_rows)
    found, by_score = calibration_of(rows)
    return BenchReport(
        "Calibration of grasp scores", ("quantity", "value"), tuple(found.items()),
        ("Ranking and success by score are of objects that were left out of the fit, one after the other.",),
        more=(Table("Success by score", Bin._fields, tuple(tuple(b) for b in by_score)),),
    )  # fmt: skip


def main(result: Path) -> None:
    """Write `calibration.json` from a saved result."""
    data = json.loads(result.read_text(encoding="utf-8"))
    adopted: dict[str, Any] = {"schema": SCHEMA}
    for name, value in data["rows"]:
        group, _, key = name.rpartition(".")
        (adopted.setdefault(group, {}) if group else adopted)[key] = value
    FILE.write_text(json.dumps(adopted | {"command": data["command"]}, indent=2) + "\n", encoding="utf-8")


def fit_rows(bench: BenchContext, job: GraspJob) -> list[Row]:
    """Drawn grasps of one job with their measures."""
    found = []
    for row in rows_of(bench, job, unweighted_pool):
        if was_tried(row):
            (measures,) = np.stack(_measures(row["cell"], row["seen"], [row["pose"]]), axis=1)
            found.append({k: v for k, v in row.items() if k not in UNSHARED} | {"measures": measures})
    return found


def unweighted_pool(cell: StandaloneContext, seen: SeenObject) -> Ranked:
    """The pool with the product of the measures for a score, so that no earlier fit has a say in what is drawn."""
    ranked = pool_of(cell, seen)
    worth = np.prod(np.stack(_measures(cell, seen, [pose for pose, _ in ranked])), axis=0) if ranked else []
    return [(pose, float(w)) for (pose, _), w in zip(ranked, worth, strict=True)]


def _measures(cell: StandaloneContext, seen: SeenObject, poses: Sequence[Se3Pose]) -> Measures:
    rng = np.random.default_rng([cell.seed, len(seen.target)])
    floor = support_below(cell, seen.target)
    T = np.array([pose.matrix for pose in poses]).reshape(-1, 4, 4)
    return misplacement_robustness(prepare(seen.target, floor, rng), T, Hand.of(cell.robot()), floor)


def calibration_of(rows: list[Row]) -> tuple[dict[str, Any], list[Bin]]:
    """The fit, what it was made from, how it ranks objects it was not fitted on, and their success by score."""
    x = np.stack([row["measures"] for row in rows])
    won = np.array([bool(row["success"]) for row in rows])
    names = np.array([row["object"] for row in rows])
    held_out = np.zeros(len(rows))
    for name in dict.fromkeys(names):
        held_out[names == name] = chance(logistic(x[names != name], won[names != name]), x[names == name])
    fit = logistic(x, won)
    unseen = [{**row, "score": score} for row, score in zip(rows, held_out, strict=True)]
    rank = ranking(unseen)
    found = {
        "intercept": round(float(fit[0]), DIGITS),
        **{f"weights.{n}": round(float(w), DIGITS) for n, w in zip(Measures._fields, fit[1:], strict=True)},
        "error.position_m": DECLARED.position,
        "error.rotation_deg": DECLARED.rotation_deg,
        "grasps": len(rows),
        "seeds": [min(row["seed"] for row in rows), max(row["seed"] for row in rows)],
        "successes": int(won.sum()),
        "each_object_left_out.auc": round(rank.auc, 3),
        "each_object_left_out.spearman": round(rank.spearman, 3),
        "each_object_left_out.calibration_error": round(rank.calibration_error, 3),
        **{f"auc_of_each_measure.{n}": round(auc(x[:, i], won), 3) for i, n in enumerate(Measures._fields)},
    }
    return found, bins(unseen)


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
    main(Path(sys.argv[1]))
