"""How an arm comes to rest: all joints together, inside their acceleration and jerk limits; and how far that takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization
from ruckig import Trajectory as RuckigTrajectory

from gap_control.joint_controller import JointCommand
from gap_control.setpoints import Setpoints
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array


class StopBounds(NamedTuple):
    """The longest a stop can take [s], and how far each joint can travel in it [rad], shape (n,)."""

    time: float
    travel: Array


def stop_bounds(spec: RobotSpec) -> StopBounds:
    """Bounds for a stop from any motion inside the limits, from the control period after it was asked for.

    The worst joint moves at full speed v and accelerates with a. In a/j its acceleration is gone, at v' = v + a^2/2j;
    then it takes v'/a + a/j to rest. The others take as long, and none is faster on the way than its own v'.
    """
    v, a, j = (np.array([getattr(x, k) for x in spec.limits]) for k in ("velocity", "acceleration", "jerk"))
    peak = v + a**2 / (2 * j)
    time = float((2 * a / j + peak / a).max())
    return StopBounds(time, peak * (time / 2 + a / j))


def stop_trajectory(spec: RobotSpec, period: float, command: JointCommand) -> Setpoints:
    """Set-points, one per `period` [s], from a moving one to rest; none when it is at rest.

    The joints slow down in proportion, which keeps the direction of the motion, unless that would take one of them
    out of its range: then each stops as soon as it can.
    """
    if not command.velocities.any():
        return Setpoints(np.empty((0, spec.dof)), np.empty((0, spec.dof)))
    together = _slow_down(spec, period, command, Synchronization.Phase)
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    if ((together.positions >= low) & (together.positions <= high)).all():
        return together
    return _slow_down(spec, period, command, Synchronization.No)


def _slow_down(spec: RobotSpec, period: float, command: JointCommand, synchronization: Synchronization) -> Setpoints:
    request, most = InputParameter(spec.dof), np.array([x.acceleration for x in spec.limits])
    request.control_interface, request.synchronization = ControlInterface.Velocity, synchronization
    request.current_position, request.current_velocity = list(command.positions), list(command.velocities)
    request.current_acceleration = list(np.clip(command.accelerations, -most, most))
    request.target_velocity = [0.0] * spec.dof
    request.max_acceleration, request.max_jerk = list(most), [x.jerk for x in spec.limits]
    profile = RuckigTrajectory(spec.dof)
    if Ruckig(spec.dof).calculate(request, profile) not in (Result.Working, Result.Finished):
        raise ArithmeticError(f"No way to stop {spec.name} from {command.velocities.tolist()} rad/s.")
    times = (1 + np.arange(int(np.ceil(profile.duration / period)))) * period
    samples = [profile.at_time(min(t, profile.duration)) for t in times]
    return Setpoints(np.array([s[0] for s in samples]), np.array([s[1] for s in samples]))
