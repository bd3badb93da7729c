import numpy as np
import pytest

from gap_motion.planning.moves import sampled
from gap_motion.planning.paths import polyline, spline, velocity_limits, without_repeats
from gap_motion.timing.timing import MotionLimits, point_to_point, time_path
from gap_runtime.contracts.types import Trajectory
from tests.unit.motion.conftest import random_joints


def ratios(trajectory, arm):
    """The largest share of each limit, from differences of the samples."""
    limits, dt = MotionLimits.of(arm.spec, 1.0, 1.0), trajectory.times[1] - trajectory.times[0]
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    found = [
        np.abs(np.diff(trajectory.positions, k + 1, axis=0) / dt ** (k + 1) / b).max() for k, b in enumerate(bounds)
    ]
    speed = np.linalg.norm(np.diff(arm.tcp_poses(trajectory.positions)[:, :3, 3], axis=0), axis=1).max() / dt
    return [*found, speed / limits.tcp_speed]


def waypoints(spec, count, seed):
    steps = np.random.default_rng(seed).normal(0, 0.4, (count, spec.dof))
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    return np.clip(np.array(spec.home) + np.cumsum(steps, axis=0), low, high)


@pytest.mark.parametrize("count", [2, 3, 7])
@pytest.mark.parametrize("seed", range(4))
def test_no_limit_is_passed_and_one_is_used(spec, arm, count, seed):
    way = waypoints(spec, count, seed)
    trajectory = point_to_point(arm, way)
    shares = ratios(trajectory, arm)
    assert max(shares) <= 1.0
    assert max(shares) > 0.9, "a motion that uses no limit could be faster"
    np.testing.assert_allclose(trajectory.positions[[0, -1]], way[[0, -1]], atol=1e-9)
    assert not trajectory.velocities[[0, -1]].any()


def test_velocities_are_the_derivative_of_positions(spec, arm):
    t = point_to_point(arm, waypoints(spec, 4, 1))
    middle = (t.positions[2:] - t.positions[:-2]) / (t.times[2:] - t.times[:-2])[:, None]
    np.testing.assert_allclose(t.velocities[1:-1], middle, atol=0.06)


def test_two_points_are_joined_by_a_straight_line(spec, arm):
    way = waypoints(spec, 2, 2)
    moved = point_to_point(arm, way).positions - way[0]
    along = (way[1] - way[0]) / np.linalg.norm(way[1] - way[0])
    np.testing.assert_allclose(moved, np.outer(moved @ along, along), atol=1e-9)


def test_rounded_corners_stay_near_the_waypoints(spec):
    way = waypoints(spec, 5, 3)
    path = polyline(way, velocity_limits(spec), corner=0.02)
    q = path(np.linspace(0, path.x[-1], 4000))
    off = [np.abs((q - p) / velocity_limits(spec)).max(axis=1).min() for p in way]
    assert max(off) <= 0.02 / 2.5 + 1e-3


def test_a_path_bends_without_jumps_in_direction_or_curvature(spec):
    path = polyline(waypoints(spec, 4, 4), velocity_limits(spec))
    inner, eps = path.x[1:-1], 1e-9
    for order, size in ((0, 1e-7), (1, 1e-6), (2, 1e-2)):
        np.testing.assert_allclose(path(inner - eps, order), path(inner + eps, order), atol=size * 10)


def test_a_spline_passes_its_waypoints(spec):
    way = waypoints(spec, 6, 5)
    path = spline(way, velocity_limits(spec))
    np.testing.assert_allclose(path(np.linspace(0, path.x[-1], 6)), way, atol=1e-12)


def test_a_speed_along_the_path_is_kept(spec, arm):
    path = polyline(waypoints(spec, 2, 6), velocity_limits(spec))
    slow = time_path(path, arm, rate=0.05)
    assert slow.duration >= path.x[-1] / 0.05


def test_going_nowhere_takes_no_time(spec, arm):
    q = np.array(spec.home)
    assert point_to_point(arm, np.stack([q, q])).duration == 0.0
    assert len(without_repeats(np.stack([q, q, q]))) == 1


def test_resampling_keeps_the_motion(spec, arm):
    t = point_to_point(arm, random_joints(spec, 2, seed=3))
    coarse = sampled(t, 0.05)
    assert isinstance(coarse, Trajectory) and abs(coarse.times[1] - 0.05) < 0.005
    np.testing.assert_allclose(coarse.positions[[0, -1]], t.positions[[0, -1]], atol=1e-12)
    assert coarse.duration == pytest.approx(t.duration)
