"""Inverse kinematics: all solutions for many poses, or the one nearest to where the arm is.

Closed forms where the arm has one (`ik_franka_like`, `ik_ur_like`), damped least squares from many seeds where it has
not. Nothing is random: equal requests give equal answers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from gap_catalogue.shared.robot_chain import Chain, joint_range
from gap_motion.kinematics import ik_franka_like, ik_ur_like
from gap_motion.kinematics.damped_least_squares import damped_least_squares, halton_seeds
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array

COARSE, FINE = 24, 10  # values of the free joint tried over its range, and around the best so far
DENSE = 240  # values tried when the coarse ones give nothing: some poses leave the free joint a window of 1 degree
SEEDS = 24  # of the numeric solver
TURN = 2 * np.pi
EDGE = 0.1  # rad: solutions closer than this to a joint limit cost extra
EDGE_COST = 2.0  # s per rad inside the edge, on the scale of `cost`
OTHERS = 0.5  # what the mean over the joints counts beside the slowest one


def candidates(chain: Chain, T: Array, near: Array, count: int = COARSE) -> Array:
    """Configurations for each of M poses of the frame behind the last joint (M, 4, 4), in the base frame.

    Returns (M, K, n), NaN where there is none. Limits are respected by the numeric solver only; see `inside`.
    """
    form = closed_form(chain)
    low, high = chain.low, chain.high
    if form is not None:
        spread_out = np.linspace(low[-1], high[-1], count if form.free else 0)
        free = np.append(spread_out, near[-1])
        found = candidates_at(chain, T, np.broadcast_to(free, (len(T), len(free))))
        return into_range(chain, found.reshape(len(T), -1, chain.dof), near)
    seeds = np.concatenate([near[None], halton_seeds(low, high, SEEDS)])
    found = damped_least_squares(chain, np.repeat(T, len(seeds), axis=0), np.tile(seeds, (len(T), 1)), (low, high))
    return found.reshape(len(T), len(seeds), chain.dof)


def into_range(chain: Chain, q: Array, near: Array) -> Array:
    """The configurations (..., n), each joint turned by whole turns: nearest to `near`, inside if it can be."""
    low, high = chain.low, chain.high
    turned = q + TURN * np.round((near - q) / TURN)
    with np.errstate(invalid="ignore"):
        if not ((turned < low) | (turned > high)).any():
            return np.asarray(turned)
        return np.asarray(
            turned + TURN * (np.ceil((low - turned) / TURN).clip(0) - np.ceil((turned - high) / TURN).clip(0))
        )


def inside(chain: Chain, q: Array, margin: float = 0.0) -> Array:
    """Which configurations (..., n) are inside the joint limits by `margin` [rad]; NaN is not."""
    low, high = chain.low, chain.high
    with np.errstate(invalid="ignore"):
        return np.asarray(((q >= low + margin) & (q <= high - margin)).all(axis=-1))


def cost(chain: Chain, q: Array, near: Array) -> Array:
    """How long configurations (..., n) are away from `near` [s], plus a charge near limits; inf for NaN.

    The slowest joint's time at full acceleration and speed counts, and the others' a little, so that none wanders.
    """
    low, high = chain.low, chain.high
    v, a = chain.velocity, chain.acceleration
    way = np.abs(q - near)
    times = np.where(way < v * v / a, 2 * np.sqrt(way / a), way / v + v / a)
    edge = np.maximum(EDGE - np.minimum(q - low, high - q), 0.0).sum(axis=-1)
    total = times.max(axis=-1) + OTHERS * times.mean(axis=-1) + EDGE_COST * edge
    return np.where(np.isnan(total), np.inf, total)


def nearest(chain: Chain, T: Array, near: Array, what: str = "the pose") -> Array:
    """The configuration (n,) for one pose (4, 4) of the frame behind the last joint that is cheapest from `near`.

    Raises `PlanningError`: `unreachable`, or `limits` with the joint that is in the way.
    """
    found = candidates(chain, T[None], near)[0]
    good = inside(chain, found)
    form = closed_form(chain)
    if form is not None and form.free and not good.any():
        found = candidates(chain, T[None], near, DENSE)[0]
        good = inside(chain, found)
    if not good.any():
        raise _why_not(chain, T, found, near, what)
    best = _cheapest(chain, found[good], near)
    low, high = chain.low, chain.high
    width = (high[-1] - low[-1]) / COARSE
    while form is not None and form.free and width > 0.005:
        free = np.clip(best[-1] + np.linspace(-width, width, FINE), low[-1], high[-1])
        more = into_range(chain, candidates_at(chain, T[None], free[None])[0].reshape(-1, chain.dof), near)
        best = _cheapest(chain, np.concatenate([best[None], more[inside(chain, more)]]), near)
        width *= 2.0 / (FINE - 1)
    return best


def free_joint_grid(chain: Chain, center: float, reach: float, count: int) -> Array | None:
    """Values of the last joint around `center` [rad] to try, or None for an arm without a closed form."""
    form = closed_form(chain)
    if form is None:
        return None
    if not form.free:
        return np.array([center])
    low, high = chain.low, chain.high
    return np.clip(center + np.linspace(-reach, reach, count), low[-1], high[-1])


def candidates_at(chain: Chain, T: Array, last: Array) -> Array:
    """All branches for M poses with K values (M, K) of the last joint each: (M, K, branches, n), NaN where none."""
    form = closed_form(chain)
    if form is None:
        raise ValueError(f"{chain.spec.name} has no closed form")
    poses = np.repeat(T, last.shape[1], axis=0)
    return form.solve(poses, last.reshape(-1)).reshape(len(T), last.shape[1], -1, chain.dof)


def _cheapest(chain: Chain, q: Array, near: Array) -> Array:
    return np.asarray(q[int(np.argmin(cost(chain, q, near)))])


@dataclass(frozen=True)
class ClosedForm:
    """`solve(T, last)` gives all branches; `free` where the last joint is a redundant one, to be chosen."""

    solve: Callable[[Array, Array], Array]
    free: bool


@lru_cache(maxsize=64)
def closed_form(chain: Chain) -> ClosedForm | None:
    """The closed form of an arm, found once per chain, or None."""
    seven, six = ik_franka_like.geometry(chain), ik_ur_like.geometry(chain)
    if seven is not None:
        return ClosedForm(partial(ik_franka_like.solve, seven), free=True)
    return ClosedForm(partial(ik_ur_like.solve, six), free=False) if six is not None else None


def _unreachable(what: str, distance: float, reach: float) -> PlanningError:
    """No configuration reaches a pose; `distance` is from the arm's shoulder, `reach` what its links add up to [m]."""
    return PlanningError(
        "unreachable",
        f"{what} cannot be reached: it is {distance:.3f} m from the shoulder, and the wrist reaches {reach:.3f} m.",
        hint="Choose a pose nearer to the arm, or another orientation.",
        detail={"distance_m": round(distance, 4), "reach_m": round(reach, 4)},
    )


def _outside_limits(spec: RobotSpec, q: Array, what: str) -> PlanningError:
    """The joint of `q` that is farthest outside its range, and by how much."""
    low, high = joint_range(spec)
    excess = np.maximum(low - q, q - high)
    worst = int(np.argmax(excess))
    return PlanningError(
        "limits",
        f"{what} needs {spec.joints[worst]} at {q[worst]:.3f} rad, {excess[worst]:.3f} rad outside "
        f"[{low[worst]:.3f}, {high[worst]:.3f}].",
        hint="Choose another pose or another rotation about the approach axis.",
        detail={"joint": spec.joints[worst], "excess_rad": round(float(excess[worst]), 5)},
    )


def _why_not(chain: Chain, T: Array, found: Array, near: Array, what: str) -> Exception:
    outside = found[~np.isnan(found).any(axis=-1)]
    if len(outside):
        low, high = chain.low, chain.high
        excess = np.maximum(low - outside, outside - high).max(axis=-1)
        return _outside_limits(chain.spec, outside[int(np.argmin(excess))], what)
    joints = chain.frames(near)[1:, 0, :3, 3]
    links = np.linalg.norm(np.diff(joints, axis=0), axis=1).sum()
    return _unreachable(what, float(np.linalg.norm(T[:3, 3] - joints[0])), float(links))
