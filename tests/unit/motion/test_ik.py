import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import joint_range
from gap_motion.kinematics import ik
from gap_motion.kinematics.damped_least_squares import damped_least_squares, halton_seeds
from gap_runtime.contracts.failures import PlanningError
from tests.unit.motion.conftest import random_joints


def last_frames(arm, q):
    return arm.poses(q, np.eye(4))


def test_the_solution_reaches_the_pose_inside_the_limits(spec, arm):
    home = np.array(spec.home)
    for T in last_frames(arm, random_joints(spec, 40)):
        q = ik.nearest(arm, T, home)
        np.testing.assert_allclose(last_frames(arm, q)[0], T, atol=2e-4)
        assert ik.inside(arm, q)


def test_where_the_arm_is_is_nearest(spec, arm):
    for q in random_joints(spec, 20, margin=0.3):
        found = ik.nearest(arm, last_frames(arm, q)[0], q)
        assert ik.cost(arm, found, q) <= ik.cost(arm, q, q) + 1e-5


def test_closed_form_finds_what_forward_kinematics_came_from(spec, arm):
    q = random_joints(spec, 200)
    found = ik.candidates_at(arm, last_frames(arm, q), q[:, -1:])[:, 0]
    gap = np.abs((found - q[:, None] + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
    assert (np.nanmin(np.where(np.isnan(gap), np.inf, gap), axis=1) < 1e-6).all()


def test_every_branch_reaches_the_pose(spec, arm):
    q = random_joints(spec, 50)
    T = last_frames(arm, q)
    found = ik.candidates_at(arm, T, q[:, -1:])[:, 0]
    pose, branch = np.nonzero(~np.isnan(found).any(axis=-1))
    np.testing.assert_allclose(last_frames(arm, found[pose, branch]), T[pose], atol=1e-9)


def test_descent_agrees_with_forward_kinematics_and_stays_inside(spec, arm):
    q = random_joints(spec, 30)
    T = last_frames(arm, q)
    found = damped_least_squares(arm, T, q + 0.1, joint_range(spec))
    solved = ~np.isnan(found).any(axis=1)
    assert solved.mean() > 0.9 and ik.inside(arm, found[solved]).all()
    np.testing.assert_allclose(last_frames(arm, found[solved]), T[solved], atol=2e-4)


def test_seeds_fill_the_joint_range_and_do_not_change(spec):
    low, high = joint_range(spec)
    seeds = halton_seeds(low, high, 64)
    assert ((seeds > low) & (seeds < high)).all()
    np.testing.assert_array_equal(seeds, halton_seeds(low, high, 64))


def test_out_of_reach_says_how_far(spec, arm):
    T = np.eye(4)
    T[0, 3] = 3.0
    with pytest.raises(PlanningError) as error:
        ik.nearest(arm, T, np.array(spec.home))
    assert error.value.code == "unreachable" and error.value.detail["distance_m"] > error.value.detail["reach_m"]


def test_a_pose_only_beyond_a_limit_names_the_joint(robot):
    from gap_catalogue.shared.robot_chain import chain

    spec = robot("panda")
    arm, q = chain(spec), np.array([0.7, 2.3, -0.3, -0.2, 0.0, -0.42, 0.7])
    with pytest.raises(PlanningError) as error:
        ik.nearest(arm, last_frames(arm, q)[0], np.array(spec.home))
    assert error.value.code == "limits"
    assert error.value.detail["joint"] in spec.joints and error.value.detail["excess_rad"] > 0
