"""Smooth joint paths: a polyline with rounded corners, or a spline through dense waypoints. Twice differentiable.

A path is a scipy PPoly over s in [0, length]; one unit of s is one second at the joints' velocity limits, so that
all joints and all arms are on one scale.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array

CORNER = 0.02  # rad, scaled by velocity limit / 2.5 rad/s: how far a rounded corner may leave its waypoint
SHARE = 0.45  # of the shorter neighbouring segment: the most that rounding a corner may use


def velocity_limits(spec: RobotSpec) -> Array:
    """Velocity limits [rad/s], shape (n,)."""
    return np.array([limit.velocity for limit in spec.limits])


def without_repeats(waypoints: Array) -> Array:
    """The waypoints (M, n) without immediate repeats; a path that does not move keeps one."""
    moved = np.abs(np.diff(waypoints, axis=0)).max(axis=1) > 1e-9
    return np.asarray(waypoints[np.concatenate([[True], moved])])


def polyline(waypoints: Array, velocity: Array, corner: float = CORNER) -> Any:
    """Straight segments through (M, n) waypoints; at each inner one the direction turns by a smooth step.

    The corner stays in the triangle of its segments and within `corner` of the waypoint.
    """
    from scipy.interpolate import PPoly

    steps = np.diff(waypoints, axis=0)
    lengths = np.abs(steps / velocity).max(axis=1)
    directions = steps / lengths[:, None]
    turns = np.abs(np.diff(directions, axis=0) / velocity).max(axis=1)
    allowed = corner / 2.5 / (0.1875 * np.maximum(turns, 1e-9))  # 0.1875 = deviation of the smooth step at its middle
    halves = np.minimum(allowed, SHARE * np.minimum(lengths[:-1], lengths[1:]))
    halves = np.concatenate([[0.0], halves, [0.0]])
    breaks, pieces, s = [0.0], [], 0.0
    for i, (length, d) in enumerate(zip(lengths, directions, strict=True)):
        straight = length - halves[i] - halves[i + 1]
        zero = np.zeros_like(d)
        pieces.append([zero, zero, zero, d, waypoints[i] + halves[i] * d])
        s += straight
        breaks.append(s)
        if i + 1 < len(lengths):
            width, turn = 2 * halves[i + 1], directions[i + 1] - d
            start = waypoints[i + 1] - halves[i + 1] * d
            pieces.append([-turn / (2 * width**3), turn / width**2, zero, d, start])
            s += width
            breaks.append(s)
    return PPoly(np.array(pieces).transpose(1, 0, 2), np.array(breaks), extrapolate=False)


def spline(waypoints: Array, velocity: Array) -> Any:
    """A cubic spline through dense (M, n) waypoints that are evenly spaced along a motion; M >= 2."""
    from scipy.interpolate import CubicSpline

    length = float(np.abs(np.diff(waypoints, axis=0) / velocity).max(axis=1).sum())
    s = np.linspace(0.0, length, len(waypoints))
    return CubicSpline(s, waypoints, bc_type="natural" if len(waypoints) > 2 else "not-a-knot", extrapolate=False)
