"""Collision-free joint paths on OMPL, with whole edges checked in one call.

Planning is deterministic: OMPL's generator is seeded for every query, budgets are counted in edges rather than in
seconds, and queries of one process take turns, because that generator is global.
"""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from gap_catalogue.shared.robot_chain import joint_range
from gap_motion.collision.checker import CollisionChecker
from gap_motion.kinematics.ik import cost
from gap_motion.planning.motion_validator import STEP, MotionValidator
from gap_motion.planning.paths import velocity_limits
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Array

RANGE = 2.0  # rad: the longest step a tree takes
EDGES = 2000  # edges a query may check before it gives up
IMPROVE_EDGES = 400  # more, when the path found is to be improved
FARTHER = (
    1.5  # times the cheapest goal's cost: farther goals, another posture of the arm, are planned to only if need be
)
_TURN = threading.Lock()


@dataclass(frozen=True)
class Path:
    """Waypoints (M, n) [rad] and which of the goals they lead to; `edges` counts what it took."""

    waypoints: Array
    goal: int
    edges: int


class PathSearch(Protocol):
    """Another way to find a path than OMPL's."""

    def __call__(self, checker: CollisionChecker, start: Array, goals: Array, seed: int) -> Array:
        """Waypoints (M, n) from start (n,) to one of goals (G, n), simplified; all these are free for the checker.

        Whoever asks checks the motion again. Raises `PlanningError`.
        """


def plan(
    checker: CollisionChecker,
    start: Array,
    goals: Array,
    seed: int = 0,
    improve: bool = False,
    step: float = STEP,
    simplify: bool = True,
    search: PathSearch | None = None,
) -> Path:
    """A short free path from start (n,) to the cheapest reachable one of goals (G, n).

    RRTConnect (Kuffner and LaValle 2000), then shortcuts; with `improve`, AORRTC (Wilson et al. 2025) spends a further
    budget on shorter ones. Between checked configurations no point moves farther than `step` [m]. A `search` stands in
    for all of that; its path is not checked here.
    Raises `PlanningError`: `in_collision` with the pair, or `no_path`.
    """
    edges = MotionValidator(checker, step)
    refuse_contact(checker, start, "The start")
    price = cost(checker.chain, goals, start)
    order = np.argsort(price, kind="stable")
    valid = order[checker.valid(goals[order])]
    if not len(valid):
        refuse_contact(checker, goals[order[0]], "Every goal; the nearest")
    if search is not None:
        rows = search(checker, start, goals[valid], seed)
        return Path(rows, _nearest(goals, valid, rows[-1]), edges.count)
    close = valid[price[valid] <= FARTHER * price[valid[0]]]
    if len(close) < len(valid):
        with suppress(PlanningError):  # then an arm's other postures count too
            return _to_one_of(edges, start, goals, close, seed, improve, simplify)
    return _to_one_of(edges, start, goals, valid, seed, improve, simplify)


def _to_one_of(
    edges: MotionValidator, start: Array, goals: Array, which: Array, seed: int, improve: bool, simplify: bool
) -> Path:
    """Straight to one of the first two goals, or else by a search to any of `which` (K,)."""
    for goal in which[:2]:
        if edges.free(start, goals[goal]):
            return Path(np.stack([start, goals[goal]]), int(goal), edges.count)
    with _TURN:
        rows = _search(edges, start, goals[which], seed, improve)
    return Path(shortcut(edges, rows, seed) if simplify else rows, _nearest(goals, which, rows[-1]), edges.count)


def _nearest(goals: Array, which: Array, q: Array) -> int:
    """The index of the goal, among `which`, that a path ends at."""
    return int(which[int(np.argmin(np.abs(goals[which] - q).max(axis=1)))])


def refuse_contact(checker: CollisionChecker, q: Array, what: str) -> None:
    """Raise `PlanningError` (`in_collision`) with the pair when a configuration (n,) is not free."""
    contact = checker.first_contact(q)
    if contact is not None:
        raise PlanningError(
            "in_collision",
            f"{what} is in collision: {contact}.",
            hint="Move away from it, or name it among the obstacles to ignore.",
            detail={"pair": [contact.link, contact.other], "depth_m": round(contact.depth, 4), "waypoint": 0},
        )


def _search(edges: MotionValidator, start: Array, goals: Array, seed: int, improve: bool) -> Array:
    from ompl import base as ob
    from ompl import geometric as og
    from ompl import util as ou

    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(seed + 1)  # zero means "do not seed"
    info, state = _space(edges)
    problem = ob.ProblemDefinition(info)
    problem.addStartState(state(start))
    targets = ob.GoalStates(info)
    for goal in goals:
        targets.addState(state(goal))
    problem.setGoal(targets)
    if improve:
        problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(info))
    planner = og.AORRTC(info) if improve else og.RRTConnect(info)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    budget = edges.count + (IMPROVE_EDGES if improve else EDGES)
    planner.solve(ob.PlannerTerminationCondition(lambda: edges.count > budget))
    if not problem.hasExactSolution():
        if improve:
            return _search(edges, start, goals, seed, improve=False)
        raise PlanningError(
            "no_path",
            f"No path was found within {EDGES} edges.",
            hint="Try another seed, another goal, or fewer obstacles.",
            detail={"edges": edges.count, "goals": len(goals)},
        )
    path = problem.getSolutionPath()
    n = edges.checker.chain.dof
    return np.array([[path.getState(k)[i] for i in range(n)] for k in range(path.getStateCount())])


def _space(edges: MotionValidator) -> tuple[Any, Any]:
    """The joint box, with motions checked whole, and a function that makes a state of a configuration."""
    from ompl import base as ob

    chain, n = edges.checker.chain, edges.checker.chain.dof
    space, bounds = ob.RealVectorStateSpace(n), ob.RealVectorBounds(n)
    for i, (low, high) in enumerate(zip(*joint_range(chain.spec), strict=True)):
        bounds.setLow(i, float(low))
        bounds.setHigh(i, float(high))
    space.setBounds(bounds)
    info = ob.SpaceInformation(space)

    def row(state: Any) -> Array:
        return np.array([state[i] for i in range(n)])

    class Motions(ob.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any, last_valid: Any = None) -> bool:
            return edges.free(row(a), row(b))

    info.setMotionValidator(Motions(info))
    info.setStateValidityChecker(lambda state: edges.checker.free(row(state)))
    info.setup()

    def state(q: Array) -> Any:
        made = space.allocState()
        for i, value in enumerate(q):
            made[i] = float(value)
        return made

    return info, state


def shortcut(edges: MotionValidator, waypoints: Array, seed: int, attempts: int = 30) -> Array:
    """A shorter free path: skip waypoints where the straight way is free, then cut random pieces off corners."""
    velocity = velocity_limits(edges.checker.chain.spec)
    rows = _skip(edges, waypoints)
    rng = np.random.default_rng(seed)
    for _ in range(attempts if len(rows) > 2 else 0):
        lengths = np.abs(np.diff(rows, axis=0) / velocity).max(axis=1)
        s = np.concatenate([[0.0], np.cumsum(lengths)])
        a, b = sorted(rng.uniform(0.0, s[-1], 2))
        i, k = (int(np.searchsorted(s, x, side="right")) - 1 for x in (a, b))
        if i == k:
            continue
        p, q = (rows[j] + (x - s[j]) / lengths[j] * (rows[j + 1] - rows[j]) for j, x in ((i, a), (k, b)))
        if np.abs((q - p) / velocity).max() < 0.99 * (b - a) and edges.free(p, q):
            rows = np.concatenate([rows[: i + 1], p[None], q[None], rows[k + 1 :]])
    return _skip(edges, rows)


def _skip(edges: MotionValidator, rows: Array) -> Array:
    """From each waypoint straight to the farthest one that can be seen from it."""
    kept, at = [0], 0
    while at < len(rows) - 1:
        ahead = next((k for k in range(len(rows) - 1, at + 1, -1) if edges.free(rows[at], rows[k])), at + 1)
        kept.append(ahead)
        at = ahead
    return np.asarray(rows[kept])
