"""How an arm comes to rest: all joints together, inside their acceleration and jerk limits; and how far that takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization
from ruckig import Trajectory as RuckigTrajectory

from gap_mujoco.control.setpoints import Setpoints
from gap_mujoco.model.compiled import TIMESTEP
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array


class Stopping(NamedTuple):
    """The longest a stop can take [s], and how far each joint can travel in it [rad], shape (n,)."""

    time: float
    travel: Array


def stopping(spec: RobotSpec) -> Stopping:
    """Bounds for a stop from any motion inside the limits, from the step after it was asked for.

    The worst joint moves at full speed v and accelerates with a. In a/j its acceleration is gone, at v' = v + a^2/2j;
    then it takes v'/a + a/j to rest. The others take as long, and none is faster on the way than its own v'.
    """
    v, a, j = (np.array([getattr(x, k) for x in spec.limits]) for k in ("velocity", "acceleration", "jerk"))
    peak = v + a**2 / (2 * j)
    time = float((2 * a / j + peak / a).max())
    return Stopping(time, peak * (time / 2 + a / j))


def braking(spec: RobotSpec, position: Array, velocity: Array, acceleration: Array) -> Setpoints:
    """Set-points from a moving one (n,) to rest; none when it is at rest.

    The joints slow down in proportion, which keeps the direction of the motion, unless that would take one of them
    out of its range: then each stops as soon as it can.
    """
    if not velocity.any():
        return Setpoints(np.empty((0, spec.dof)), np.empty((0, spec.dof)))
    together = _slow_down(spec, position, velocity, acceleration, Synchronization.Phase)
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    if ((together.positions >= low) & (together.positions <= high)).all():
        return together
    return _slow_down(spec, position, velocity, acceleration, Synchronization.No)


def _slow_down(spec: RobotSpec, q: Array, dq: Array, ddq: Array, synchronization: Synchronization) -> Setpoints:
    profile, most = InputParameter(spec.dof), np.array([x.acceleration for x in spec.limits])
    profile.control_interface, profile.synchronization = ControlInterface.Velocity, synchronization
    profile.current_position, profile.current_velocity = list(q), list(dq)
    profile.current_acceleration = list(np.clip(ddq, -most, most))
    profile.target_velocity = [0.0] * spec.dof
    profile.max_acceleration, profile.max_jerk = list(most), [x.jerk for x in spec.limits]
    course = RuckigTrajectory(spec.dof)
    if Ruckig(spec.dof).calculate(profile, course) not in (Result.Working, Result.Finished):
        raise ArithmeticError(f"No way to stop {spec.name} from {dq.tolist()} rad/s.")
    times = (1 + np.arange(int(np.ceil(course.duration / TIMESTEP)))) * TIMESTEP
    samples = [course.at_time(min(t, course.duration)) for t in times]
    return Setpoints(np.array([s[0] for s in samples]), np.array([s[1] for s in samples]))
