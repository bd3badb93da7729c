"""Time-parameterisation: as fast along a path as velocity, acceleration, jerk and TCP speed allow.

First the time-optimal speed under velocity and acceleration limits by one backward and one forward pass over the path
(Pham and Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis", T-RO 2018, with
the passes in closed form). Then two moving averages over time, which bound jerk and keep the other bounds, since an
average of admissible velocities or accelerations is admissible. A last uniform stretch settles what sampling left, and
what the motors could not carry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_motion.kinematics.dynamics import torque_stretch
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory

PERIOD = 0.01  # s between samples of a trajectory
FINE = 0.002  # s between the samples that averages and checks work on
SMOOTH = 0.016  # s: the wider average; longer where jerk asks for it
MARGIN = 0.97  # of accelerations, jerks and TCP speed is used: the arm still has to track what is planned
SPEED = 0.97  # of joint speeds


@dataclass(frozen=True)
class MotionLimits:
    """Shapes (n,), in rad and seconds; `tcp_speed` [m/s]."""

    velocity: Array
    acceleration: Array
    jerk: Array
    tcp_speed: float

    @classmethod
    def of(cls, spec: RobotSpec, speed: float = SPEED, rest: float = MARGIN) -> MotionLimits:
        """A robot's limits: `speed` of its joint velocities, `rest` of everything else."""
        v, a, j = (np.array([getattr(x, k) for x in spec.limits]) for k in ("velocity", "acceleration", "jerk"))
        return cls(speed * v, rest * a, rest * j, rest * spec.tcp_velocity)


def time_path(path: Any, arm: Chain, limits: MotionLimits | None = None, rate: Array | float = np.inf) -> Trajectory:
    """The fastest trajectory along a path (see `paths`), at rest at both ends.

    `rate` bounds the speed along the path in units of s per second, for all of it or, shape (G,), on an even grid over
    it (Cartesian speed limits come in this way).
    """
    limits = limits or MotionLimits.of(arm.spec)
    length = float(path.x[-1])
    if length <= 0 or not np.isfinite(length):
        q = path(0.0) if np.isfinite(length) else path.c[-1, 0]
        return Trajectory(np.zeros(1), np.atleast_2d(q), np.zeros((1, arm.dof)))
    grid = np.linspace(0.0, length, int(np.clip(20 * len(path.x), 120, 300)))
    speed = _speeds(path, grid, arm, limits, rate)
    s, ds = _at_even_times(grid, speed)
    q, dq = path(s), path(s, 1) * ds[:, None]
    wide = int(np.ceil(max(SMOOTH, 2.2 * float((limits.acceleration / limits.jerk).max())) / FINE))
    for width in (wide, max(2, wide // 2)):
        q, dq = _average(q, width), _average(dq, width)
    times = np.arange(len(q)) * FINE * _stretch(q, limits, arm)
    count = max(2, round(times[-1] / PERIOD) + 1)
    even = np.linspace(0.0, times[-1], count)
    positions, velocities = _hermite(times, q, dq * FINE / (times[1] - times[0]), even)
    slower = torque_stretch(arm, positions, velocities, float(even[1]))
    even, velocities = even * slower, velocities / slower
    positions[0], positions[-1] = path(0.0), path(length)  # to the last bit, which averaging loses
    return Trajectory(even, positions, velocities)


def point_to_point(arm: Chain, waypoints: Array, limits: MotionLimits | None = None) -> Trajectory:
    """The fastest trajectory along the polyline through (M, n) configurations, corners rounded."""
    from gap_motion.planning.paths import polyline, velocity_limits, without_repeats

    waypoints = without_repeats(np.asarray(waypoints, dtype=float))
    if len(waypoints) < 2:
        return Trajectory(np.zeros(1), waypoints, np.zeros((1, arm.dof)))
    return time_path(polyline(waypoints, velocity_limits(arm.spec)), arm, limits)


def _speeds(path: Any, grid: Array, arm: Chain, limits: MotionLimits, rate: Array | float) -> Array:
    """Speed along the path at the grid points [1/s], zero at both ends."""
    d1, d2 = path(grid, 1), path(grid, 2)
    tcp = arm.tcp_poses(path(grid))[:, :3, 3]
    travel = np.linalg.norm(np.gradient(tcp, grid, axis=0), axis=1)
    cap = (limits.velocity / np.maximum(np.abs(d1), 1e-9)).min(axis=1)
    cap = np.minimum(cap, limits.tcp_speed / np.maximum(travel, 1e-9))
    if np.ndim(rate):
        rate = np.interp(grid, np.linspace(0, grid[-1], np.size(rate)), rate)
    ceiling = np.minimum(np.minimum(cap, rate) ** 2, _curvature_bound(d1, d2, limits.acceleration))
    step = float(grid[1] - grid[0])
    back = _pass(ceiling[::-1], -d1[::-1], d2[::-1], limits.acceleration, step)[::-1]
    return np.asarray(np.sqrt(_pass(back, d1, d2, limits.acceleration, step)))


def _curvature_bound(d1: Array, d2: Array, a: Array) -> Array:
    """The largest squared speed x at each point for which some u satisfies |d1 u + d2 x| <= a in every joint."""
    p, m = d1[:, :, None] * d2[:, None, :], a[:, None] * np.abs(d1)[:, None, :] + a * np.abs(d1)[:, :, None]
    twist = np.abs(p - p.transpose(0, 2, 1))  # joints that bend differently cannot all be served by one u
    pairs = np.where(twist > 1e-12, m / np.maximum(twist, 1e-12), np.inf).min(axis=(1, 2))
    still = np.where(np.abs(d1) < 1e-9, a / np.maximum(np.abs(d2), 1e-12), np.inf).min(axis=1)
    return np.asarray(np.minimum(pairs, still))


def _pass(ceiling: Array, d1: Array, d2: Array, a: Array, step: float) -> Array:
    """Squared speeds reachable from rest at the first point: each step as fast as the acceleration limits let it.

    With u the acceleration along the path, x' = x + 2 step u; in joint j, |d1 u + d2 x| <= a bounds u from above by
    (a - sign(d1) d2 x) / |d1|, taken at the end of the step so that both ends of a step are admissible.
    """
    size = np.maximum(np.abs(d1), 1e-9)
    push, bend = 2 * step * a / size, 2 * step * np.sign(d1) * d2 / size
    end = 1.0 / np.maximum(1.0 + bend[1:], 1e-9)
    still = np.where(bend[1:] > -1.0, push[1:] * end, np.inf)  # bounds are still + x * gain, joint by joint
    constant, gain = np.concatenate([push[:-1], still], axis=1), np.concatenate([1.0 - bend[:-1], end], axis=1)
    along = (constant + gain * ceiling[:-1, None]).min(axis=1) >= ceiling[1:]  # steps that can follow the ceiling
    x, at_ceiling, out = 0.0, False, [0.0]
    for top, can, c, g in zip(ceiling[1:].tolist(), along.tolist(), constant, gain, strict=True):
        x = top if at_ceiling and can else max(min(top, float((c + g * x).min())), 0.0)
        at_ceiling = x == top
        out.append(x)
    return np.array(out)


def _at_even_times(grid: Array, speed: Array) -> tuple[Array, Array]:
    """Position and speed along the path every FINE seconds; between grid points acceleration is constant."""
    gaps = np.diff(grid)
    spans = 2 * gaps / np.maximum(speed[:-1] + speed[1:], 1e-6)
    at = np.concatenate([[0.0], np.cumsum(spans)])
    times = np.arange(0.0, at[-1] + FINE, FINE)
    i = np.minimum(np.searchsorted(at, times, side="right") - 1, len(gaps) - 1)
    tau = np.minimum(times - at[i], spans[i])
    u = (speed[i + 1] - speed[i]) / spans[i]
    s = np.clip(grid[i] + speed[i] * tau + 0.5 * u * tau**2, 0.0, grid[-1])
    return s, np.where(times >= at[-1], 0.0, speed[i] + u * tau)


def _average(rows: Array, width: int) -> Array:
    """Moving average over `width` samples along axis 0, with the ends held; grows by width - 1 samples."""
    held = np.concatenate([np.repeat(rows[:1], width - 1, axis=0), rows, np.repeat(rows[-1:], width - 1, axis=0)])
    total = np.concatenate([np.zeros_like(rows[:1]), np.cumsum(held, axis=0)])
    return np.asarray((total[width:] - total[:-width]) / width)


def _stretch(q: Array, limits: MotionLimits, arm: Chain) -> float:
    """How much slower the sampled motion must run to be inside every limit; at least 1."""
    tcp = arm.tcp_poses(q[::2])[:, :3, 3]
    travel = np.linalg.norm(np.diff(tcp, axis=0), axis=1) / (2 * FINE)
    worst = max(1.0, float(travel.max(initial=0.0)) / limits.tcp_speed)
    for order, bound in ((1, limits.velocity), (2, limits.acceleration), (3, limits.jerk)):
        if len(q) > order:
            ratio = float((np.abs(np.diff(q, order, axis=0)) / FINE**order / bound).max())
            worst = max(worst, ratio ** (1.0 / order))
    return worst


def _hermite(times: Array, q: Array, dq: Array, even: Array) -> tuple[Array, Array]:
    """Positions and velocities at `even` times from cubic Hermite interpolation of samples."""
    from scipy.interpolate import CubicHermiteSpline

    curve = CubicHermiteSpline(times, q, dq)
    positions, velocities = curve(even), curve(even, 1)
    velocities[0], velocities[-1] = 0.0, 0.0
    return positions, velocities
