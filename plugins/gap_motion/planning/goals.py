"""Goal configurations: for each of many TCP poses, the few cheapest ones that are inside all limits and free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_motion.collision.checker import CollisionChecker
from gap_motion.kinematics.ik import DENSE, candidates, closed_form, cost, inside
from gap_runtime.contracts.types import Array

TRY, KEEP = 6, 3  # per pose: configurations checked for collision first, and kept
PIECE = 48  # of all poses' configurations, cheapest first, how many are checked at a time
FEW = 10  # values of a free joint tried per pose when there are many poses


def within_limits(chain: Chain, T: Array, near: Array) -> list[Array]:
    """Configurations inside the joint limits for each of M poses of the frame behind the last joint, cheapest first."""
    found = candidates(chain, T, near, FEW if len(T) > 4 else 24)
    good, price = inside(chain, found), cost(chain, found, near)
    rows = [q[g][np.argsort(p[g], kind="stable")] for q, g, p in zip(found, good, price, strict=True)]
    return [q if len(q) else _dense(chain, pose, near) for q, pose in zip(rows, T, strict=True)]


def _dense(chain: Chain, T: Array, near: Array) -> Array:
    """Configurations for a pose (4, 4) that leaves a free joint a narrow window, cheapest first; (0, n) for none."""
    form = closed_form(chain)
    if form is None or not form.free:
        return np.zeros((0, chain.dof))
    found = candidates(chain, T[None], near, DENSE)[0]
    found = found[inside(chain, found)]
    return np.asarray(found[np.argsort(cost(chain, found, near), kind="stable")])


def cheapest_free(checker: CollisionChecker, T: Array, near: Array, keep: int = KEEP) -> Iterator[tuple[Array, int]]:
    """Free configurations (n,) for any of M poses, cheapest first over all poses, each with the index of its pose.

    At most `keep` for a pose. They are checked as they are asked for, so the first ones come soon.
    """
    chain = checker.chain
    found = candidates(chain, T, near, FEW if len(T) > 4 else 24)
    good = inside(chain, found)
    owner, q = np.nonzero(good)[0], found[good]
    order = np.argsort(cost(chain, q, near), kind="stable")
    given = np.zeros(len(T), dtype=int)
    for part in (order[i : i + PIECE] for i in range(0, len(order), PIECE)):
        for k in part[checker.valid(q[part])]:
            if given[owner[k]] < keep:
                given[owner[k]] += 1
                yield q[k], int(owner[k])
    for i in np.flatnonzero(~good.any(axis=1)):
        for free in _valid(checker, [_dense(chain, T[i], near)])[0][:keep]:
            yield free, int(i)


def free_goals(checker: CollisionChecker, rows: list[Array], keep: int = KEEP) -> list[Array]:
    """Of each pose's configurations, cheapest first, at most `keep` that are free, all checked in two calls."""
    first = _valid(checker, [q[:TRY] for q in rows])
    late = [i for i, q in enumerate(first) if not len(q) and len(rows[i]) > TRY]
    for i, q in zip(late, _valid(checker, [rows[i][TRY:] for i in late]), strict=True):
        first[i] = q
    return [q[:keep] for q in first]


def _valid(checker: CollisionChecker, rows: list[Array]) -> list[Array]:
    sizes = [len(q) for q in rows]
    if not sum(sizes):
        return rows
    ok = checker.valid(np.concatenate(rows))
    return [q[part] for q, part in zip(rows, np.split(ok, np.cumsum(sizes)[:-1]), strict=True)]
