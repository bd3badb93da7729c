"""A jerk-limited straight line between two joint configurations, at half of the robot's limits."""

from __future__ import annotations

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Synchronization
from ruckig import Trajectory as RuckigTrajectory

from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory

LIMIT_SHARE = 0.5  # of every limit
PERIOD = 0.01  # [s]


def point_to_point(spec: RobotSpec, start: Array, goal: Array) -> Trajectory:
    """At rest at both ends, joints (n,) in proportion. Raises `BadRequestError`, `PlanningError`."""
    if np.shape(goal) != (spec.dof,) or not np.isfinite(goal).all():
        raise BadRequestError("joints", f"{spec.name} needs {spec.dof} finite joint positions.")
    request, profile = InputParameter(spec.dof), RuckigTrajectory(spec.dof)
    request.current_position, request.target_position = list(start), list(goal)
    request.max_velocity = [LIMIT_SHARE * j.velocity for j in spec.limits]
    request.max_acceleration = [LIMIT_SHARE * j.acceleration for j in spec.limits]
    request.max_jerk = [LIMIT_SHARE * j.jerk for j in spec.limits]
    request.synchronization = Synchronization.Phase
    if Ruckig(spec.dof).calculate(request, profile) not in (Result.Working, Result.Finished):
        raise PlanningError("timing", f"No motion of {spec.name} between these joint positions.")
    if profile.duration <= 0:
        return Trajectory(np.zeros(1), np.array([goal]), np.zeros((1, spec.dof)))
    times = np.linspace(0, profile.duration, max(2, int(np.ceil(profile.duration / PERIOD)) + 1))
    samples = [profile.at_time(t) for t in times]
    return Trajectory(times, np.array([s[0] for s in samples]), np.array([s[1] for s in samples]))
