"""Checks a commanded trajectory whole before anything moves, and turns it into one set-point per time step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from gap_control.joint_controller import JointCommand
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory

START_TOLERANCE = 0.02  # [rad] between a trajectory's start and the arm
SLACK = 1e-3  # relative: what rounding and cubic interpolation may add to a planned limit
POSITION_SLACK = 1e-4  # [rad]
MAX_DURATION = 120.0  # [s]
BLEND = 0.1  # [s] over which a small mismatch at the start is taken out


class Setpoints(NamedTuple):
    """One row per control period: joint positions [rad] and velocities [rad/s], shape (T, n)."""

    positions: Array
    velocities: Array


def setpoints(
    trajectory: Trajectory,
    spec: RobotSpec,
    period: float,
    measured: Array,
    commanded: Array,
    takeover: JointCommand | None = None,
) -> Setpoints:
    """Set-points, one per `period` [s], that lead smoothly from the `commanded` joints into the trajectory, to its end.

    Cubic between points where velocities are given, else linear. With `takeover` the trajectory must take over from
    that set-point as it moves. Raises `MotionError` code `refused` when the trajectory is not finite, not for this arm,
    leaves a joint limit, or does not start at the `measured` joints or go on from the set-point of `takeover`.
    """
    _check_form(trajectory, spec)
    if takeover is not None:
        _check_takeover(trajectory, spec, period, takeover)
        measured = commanded = takeover.positions
    error = np.abs(trajectory.positions[0] - measured)
    if error.max() > START_TOLERANCE:
        worst = int(error.argmax())
        raise refused(
            f"the trajectory starts {error[worst]:.3f} rad away from where {spec.joints[worst]} is",
            f"Start it at the measured joints (within {START_TOLERANCE} rad).",
        )
    points = _interpolate(trajectory, period)
    _check_limits(points, spec)
    t = np.minimum((1 + np.arange(len(points.positions))) * period / BLEND, 1.0)[:, None]
    mismatch = commanded - trajectory.positions[0]
    fade, rate = (1 - t) ** 2 * (1 + 2 * t), -6 * t * (1 - t) / BLEND
    return Setpoints(points.positions + fade * mismatch, points.velocities + rate * mismatch)


def refused(problem: str, hint: str = "") -> MotionError:
    """The error of a command that was not begun."""
    return MotionError("refused", f"Motion refused: {problem}.", hint=hint)


def _check_form(trajectory: Trajectory, spec: RobotSpec) -> None:
    times, positions, velocities = trajectory.times, trajectory.positions, trajectory.velocities
    if len(times) == 0 or positions.shape[1] != spec.dof:
        raise refused(f"it has {len(times)} points of {positions.shape[1]} joints, {spec.name} has {spec.dof}")
    arrays = [times, positions] if velocities is None else [times, positions, velocities]
    if not all(np.isfinite(a).all() for a in arrays):
        raise refused("it holds a number that is not finite")
    if velocities is not None and velocities.shape != positions.shape:
        raise refused(f"velocities have shape {velocities.shape}, positions {positions.shape}")
    if times[0] != 0 or (np.diff(times) <= 0).any():
        raise refused("times must start at 0 and grow")
    if times[-1] > MAX_DURATION:
        raise refused(f"it lasts {times[-1]:.0f} s, longer than {MAX_DURATION:.0f} s")


def _check_takeover(trajectory: Trajectory, spec: RobotSpec, period: float, takeover: JointCommand) -> None:
    """One period at the joint's acceleration limit, and rounding, is all the velocity may change by."""
    if trajectory.velocities is None:
        raise refused("a trajectory that takes over from a motion needs velocities")
    limits = np.array([x.acceleration for x in spec.limits])
    jump = np.abs(trajectory.velocities[0] - takeover.velocities)
    if (jump > limits * period + SLACK).any():
        worst = int((jump / limits).argmax())
        raise refused(
            f"{spec.joints[worst]} moves at {takeover.velocities[worst]:.3f} rad/s, "
            f"the trajectory starts at {trajectory.velocities[0][worst]:.3f} rad/s",
            "Begin it at Arm.setpoint().",
        )


def _interpolate(trajectory: Trajectory, period: float) -> Setpoints:
    end = trajectory.times[-1]
    t = np.minimum((1 + np.arange(max(1, int(np.ceil(end / period - 1e-9))))) * period, end)
    if len(trajectory.times) == 1:
        return Setpoints(trajectory.positions.copy(), np.zeros_like(trajectory.positions))
    if trajectory.velocities is not None:
        curve = CubicHermiteSpline(trajectory.times, trajectory.positions, trajectory.velocities)
        return Setpoints(curve(t), curve.derivative()(t))
    positions = np.column_stack([np.interp(t, trajectory.times, column) for column in trajectory.positions.T])
    velocities = np.diff(trajectory.positions, axis=0) / np.diff(trajectory.times)[:, None]
    return Setpoints(positions, velocities[np.clip(np.searchsorted(trajectory.times, t) - 1, 0, len(velocities) - 1)])


def _check_limits(points: Setpoints, spec: RobotSpec) -> None:
    lower, upper, velocity = (np.array([getattr(j, k) for j in spec.limits]) for k in ("lower", "upper", "velocity"))
    beyond = np.maximum(lower - points.positions, points.positions - upper).max(axis=0)
    if beyond.max() > POSITION_SLACK:
        worst = int(beyond.argmax())
        raise refused(
            f"{spec.joints[worst]} would leave its range by {beyond[worst]:.4f} rad",
            f"It may move between {lower[worst]:.4f} and {upper[worst]:.4f} rad.",
        )
    ratio = np.abs(points.velocities).max(axis=0) / velocity
    if ratio.max() > 1 + SLACK:
        worst = int(ratio.argmax())
        raise refused(
            f"{spec.joints[worst]} would move at {ratio[worst] * velocity[worst]:.3f} rad/s",
            f"Its limit is {velocity[worst]:.3f} rad/s.",
        )
