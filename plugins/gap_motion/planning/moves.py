"""Single-arm motions as timed trajectories: free joint motion, and straight lines of the TCP."""

from __future__ import annotations

import numpy as np

from gap_motion.arguments import STEP, ArmModel
from gap_motion.kinematics.ik import nearest
from gap_motion.planning.line import follow, interpolate, waypoint_count
from gap_motion.planning.paths import polyline, spline, velocity_limits, without_repeats
from gap_motion.timing.timing import point_to_point, time_path
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory


def to_pose(cell: ArmModel, start: Array, last_joint_frame: Array, z_approach: float = 0.0) -> Trajectory:
    """Joint motion to the configuration nearest to `start` for a pose (4, 4) of the frame behind the last joint.

    With `z_approach` [m], first to the pose backed off along the TCP's approach axis, then straight in without
    stopping between. Raises `PlanningError`.
    """
    if z_approach == 0.0:
        return point_to_point(
            cell.chain, np.stack([start, nearest(cell.chain, last_joint_frame, start, "the target pose")])
        )
    before = pregrasp_pose(cell, last_joint_frame, z_approach)
    q = nearest(cell.chain, before, start, "the pose before the target")
    way = interpolate(before, last_joint_frame, waypoint_count(before, last_joint_frame))
    rows = np.concatenate([start[None], follow(cell.chain, way, q, "the approach")])
    return time_path(polyline(without_repeats(rows), velocity_limits(cell.spec)), cell.chain)


def cartesian_line(
    cell: ArmModel, start: Array, goal: Array, count: int = 0, speed: float = np.inf, turning: float = np.inf
) -> Trajectory:
    """A straight line of the TCP from the joints `start` (n,) to `goal` (4, 4), both as frames behind the last joint.

    `speed` [m/s] and `turning` [rad/s] bound the TCP, `count` is the least number of waypoints. Raises `PlanningError`.
    """
    rows, distance, angle = line_waypoints(cell, start, goal, count)
    if len(rows) < 2:
        return point_to_point(cell.chain, rows)
    path = spline(rows, velocity_limits(cell.spec))
    fastest = max(distance / speed, angle / turning, 1e-9)  # s at constant speed
    return time_path(path, cell.chain, rate=float(path.x[-1]) / fastest)


def line_waypoints(cell: ArmModel, start: Array, goal: Array, count: int = 0) -> tuple[Array, float, float]:
    """Joint waypoints (M, n) along the TCP's line, its length [m] and the angle it turns [rad]."""
    T_start, T_goal = (cell.chain.poses(start, cell.chain.tcp)[0], goal @ cell.chain.tcp)
    distance = float(np.linalg.norm(T_goal[:3, 3] - T_start[:3, 3]))
    cosine = (np.trace(T_goal[:3, :3] @ T_start[:3, :3].T) - 1) / 2
    angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if distance < 1e-5 and angle < 1e-4:
        return start[None], distance, angle
    way = interpolate(T_start, T_goal, max(count, waypoint_count(T_start, T_goal)))
    return follow(cell.chain, way @ np.linalg.inv(cell.chain.tcp), start), distance, angle


def pregrasp_pose(cell: ArmModel, last_joint_frame: Array, distance: float) -> Array:
    """Poses (..., 4, 4) of the frame behind the last joint, `distance` [m] back along the TCP's approach axis."""
    T = last_joint_frame.copy()
    T[..., :3, 3] -= distance * (last_joint_frame @ cell.chain.tcp)[..., :3, 2]
    return T


def within_steps(trajectory: Trajectory, max_steps: int, spec: RobotSpec) -> Trajectory:
    """The trajectory, when it is done in `max_steps` control periods, which last longer for a slower arm.

    Raises `PlanningError` (`budget`).
    """
    step = STEP * spec.time_scale
    if trajectory.duration > max_steps * step:
        raise PlanningError(
            "budget",
            f"The motion takes {trajectory.duration:.2f} s, more than max_steps = {max_steps} allow "
            f"({max_steps * step:.2f} s at {step:.3g} s a step of {spec.name}).",
            hint=f"Give max_steps={int(np.ceil(trajectory.duration / step))}.",
        )
    return trajectory


def sampled(trajectory: Trajectory, period: float) -> Trajectory:
    """The same motion with points `period` [s] apart, or as near to that as divides it evenly."""
    from scipy.interpolate import CubicHermiteSpline

    if len(trajectory.times) < 2 or trajectory.velocities is None:
        return trajectory
    curve = CubicHermiteSpline(trajectory.times, trajectory.positions, trajectory.velocities)
    times = np.linspace(0.0, trajectory.duration, max(2, round(trajectory.duration / period) + 1))
    return Trajectory(times, curve(times), curve(times, 1))
