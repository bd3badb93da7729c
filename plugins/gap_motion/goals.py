"""Goal configurations: for each of many TCP poses, the few cheapest ones that are inside all limits and free."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.types import Array
from gap_motion.checker import Checker
from gap_motion.ik import DENSE, candidates, closed_form, cost, inside
from gap_motion.kinematics import Chain

TRY, KEEP = 6, 3  # per pose: configurations checked for collision first, and kept
FEW = 10  # values of a free joint tried per pose when there are many poses


def within_limits(chain: Chain, T: Array, near: Array) -> list[Array]:
    """Configurations inside the joint limits for each of M poses of the frame behind the last joint, cheapest first."""
    found = candidates(chain, T, near, FEW if len(T) > 4 else 24)
    good, price = inside(chain, found), cost(chain, found, near)
    rows = [q[g][np.argsort(p[g], kind="stable")] for q, g, p in zip(found, good, price, strict=True)]
    form = closed_form(chain)
    for i, q in enumerate(rows):
        if not len(q) and form is not None and form.free:
            dense = candidates(chain, T[i : i + 1], near, DENSE)[0]
            dense = dense[inside(chain, dense)]
            rows[i] = dense[np.argsort(cost(chain, dense, near), kind="stable")]
    return rows


def free_goals(checker: Checker, rows: list[Array], keep: int = KEEP) -> list[Array]:
    """Of each pose's configurations, cheapest first, at most `keep` that are free, all checked in two calls."""
    first = _valid(checker, [q[:TRY] for q in rows])
    late = [i for i, q in enumerate(first) if not len(q) and len(rows[i]) > TRY]
    for i, q in zip(late, _valid(checker, [rows[i][TRY:] for i in late]), strict=True):
        first[i] = q
    return [q[:keep] for q in first]


def _valid(checker: Checker, rows: list[Array]) -> list[Array]:
    sizes = [len(q) for q in rows]
    if not sum(sizes):
        return rows
    ok = checker.valid(np.concatenate(rows))
    return [q[part] for q, part in zip(rows, np.split(ok, np.cumsum(sizes)[:-1]), strict=True)]
