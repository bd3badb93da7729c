"""A jerk-limited straight line between two joint configurations, at half of the robot's limits."""

from __future__ import annotations

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Synchronization
from ruckig import Trajectory as RuckigTrajectory

from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory

SHARE = 0.5  # of every limit
PERIOD = 0.01  # [s]


def joint_move(spec: RobotSpec, start: Array, goal: Array) -> Trajectory:
    """At rest at both ends, every joint on the same course. Raises `BadRequestError`, `PlanningError`."""
    if np.shape(goal) != (spec.dof,) or not np.isfinite(goal).all():
        raise BadRequestError("joints", f"{spec.name} needs {spec.dof} finite joint positions.")
    profile = InputParameter(spec.dof)
    profile.current_position, profile.target_position = list(start), list(goal)
    profile.max_velocity = [SHARE * j.velocity for j in spec.limits]
    profile.max_acceleration = [SHARE * j.acceleration for j in spec.limits]
    profile.max_jerk = [SHARE * j.jerk for j in spec.limits]
    profile.synchronization = Synchronization.Phase
    course = RuckigTrajectory(spec.dof)
    if Ruckig(spec.dof).calculate(profile, course) not in (Result.Working, Result.Finished):
        raise PlanningError("timing", f"No motion of {spec.name} between these joint positions.")
    times = np.linspace(0, course.duration, max(2, int(np.ceil(course.duration / PERIOD)) + 1))
    if course.duration <= 0:
        return Trajectory(np.zeros(1), np.array([goal]), np.zeros((1, spec.dof)))
    samples = [course.at_time(t) for t in times]
    return Trajectory(times, np.array([s[0] for s in samples]), np.array([s[1] for s in samples]))
