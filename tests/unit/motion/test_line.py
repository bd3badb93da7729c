import numpy as np
import pytest

from gap_motion.arguments import ArmModel
from gap_motion.kinematics import ik
from gap_motion.planning.line import follow, interpolate, waypoint_count
from gap_motion.planning.moves import cartesian_line, to_pose
from gap_runtime.contracts.failures import PlanningError


@pytest.fixture
def here(cell):
    return ArmModel(cell.arm)


def shifted(cell, *offset):
    offset = offset or (0, 0, 0)
    T = cell.tcp(cell.joints())[0].copy()
    T[:3, 3] += offset
    return T


def distance_from_line(points, a, b):
    along = (b - a) / np.linalg.norm(b - a)
    off = points - a
    return np.linalg.norm(off - np.outer(off @ along, along), axis=1).max()


def test_interpolation_starts_and_ends_where_asked(here):
    a, b = shifted(here), shifted(here, 0.1, 0.0, -0.2)
    way = interpolate(a, b, waypoint_count(a, b))
    np.testing.assert_allclose(way[[0, -1]], np.stack([a, b]), atol=1e-12)


@pytest.mark.parametrize("offset", [(0, 0, -0.3), (0.1, 0.1, -0.1), (-0.05, 0.2, 0.0), (0, 0, 0.05)])
def test_the_tcp_stays_on_the_line(here, offset):
    start, goal = here.joints(), shifted(here, *offset)
    planned = cartesian_line(here, start, here.last_joint_frame(goal))
    T = here.tcp(planned.positions)
    assert distance_from_line(T[:, :3, 3], T[0, :3, 3], goal[:3, 3]) < 1e-3
    np.testing.assert_allclose(T[-1], goal, atol=1e-4)
    assert np.abs(np.diff(planned.positions, axis=0)).max() < 0.05


def test_the_tcp_keeps_to_the_speed_asked_for(here):
    planned = cartesian_line(here, here.joints(), here.last_joint_frame(shifted(here, 0, 0, -0.2)), speed=0.1)
    steps = np.linalg.norm(np.diff(here.tcp(planned.positions)[:, :3, 3], axis=0), axis=1)
    assert steps.max() / (planned.times[1] - planned.times[0]) <= 0.101


def test_an_upright_upper_arm_is_passed_through(robot):
    from gap_catalogue.shared.robot_chain import chain

    arm = chain(robot("panda"))
    q = np.array([-0.03, 0.014, -0.123, -2.507, 0.003, 2.521, 1.246])
    start, goal = arm.tcp_poses(q)[0], arm.tcp_poses(q)[0]
    goal[:3, 3] += [0.1, 0.15, 0.1]
    way = interpolate(start, goal, waypoint_count(start, goal)) @ np.linalg.inv(arm.tcp)
    rows = follow(arm, way, q)
    np.testing.assert_allclose(arm.poses(rows, np.eye(4)), way, atol=2e-4)
    assert np.abs(np.diff(rows, axis=0)).max() < 0.35


def test_a_line_that_leaves_the_reach_names_the_waypoint(here):
    with pytest.raises(PlanningError) as error:
        cartesian_line(here, here.joints(), here.last_joint_frame(shifted(here, 2.0, 0, 0)))
    assert error.value.code in {"unreachable", "limits", "no_path"} and error.value.detail["waypoint"] > 0


def test_an_approach_ends_with_a_straight_stretch(here):
    goal = shifted(here, 0.05, 0.1, -0.2)
    planned = to_pose(here, here.joints(), here.last_joint_frame(goal), 0.08)
    T = here.tcp(planned.positions)
    near = np.linalg.norm(T[:, :3, 3] - goal[:3, 3], axis=1) < 0.06
    assert distance_from_line(T[near, :3, 3], goal[:3, 3], goal[:3, 3] - 0.1 * goal[:3, 2]) < 2e-3
    assert ik.inside(here.chain, planned.positions).all()
