"""Targets of a policy add up, and only those the arm can follow are taken."""

import numpy as np
import pytest

from gap_motion.arguments import ArmModel
from gap_motion.timing.limits import check_trajectory_limits
from gap_motion.timing.policy_step import MOST_LAG, begin, step, to_rest
from gap_runtime.contracts.arm import Setpoint
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3
from tests.unit.motion.conftest import IdealArm

ACTION = np.array([0.1, -0.2, -0.1, 0.0, 0.0, 0.05, 0.0])
NEAR = Se3Pose(  # 1.2 m in front of the arm, facing it
    Vec3(-0.6 + 1.2 * np.cos(0.6), 0.1 + 1.2 * np.sin(0.6), 0.0),
    Quaternion(0.2955202066613396, 0.0, 0.0, -0.9553364891256060),
)


def test_many_small_targets_are_one_large_one(cell):
    here, count = ArmModel(cell.arm), 10
    stream = begin(here)
    first = stream.target
    for _ in range(count):
        stream = step(here, stream, ACTION)
    np.testing.assert_allclose(stream.target[:3, 3] - first[:3, 3], count * 0.05 * ACTION[:3], atol=1e-9)
    reached = here.chain.tcp_poses(stream.goal)[0]
    np.testing.assert_allclose(reached, stream.target, atol=1e-3)


def test_an_action_that_moves_nothing_leaves_the_target(cell):
    here = ArmModel(cell.arm)
    stream = begin(here)
    assert step(here, stream, np.array([0, 0, 0, 0, 0, 0, 1.0])) is stream


def test_what_is_sent_goes_on_from_the_motion_and_passes_the_filter(cell, spec):
    here = ArmModel(cell.arm)
    goal = step(here, begin(here), ACTION).goal
    still = cell.arm.setpoint()
    first = to_rest(here, still, goal)
    check_trajectory_limits(here, first, cell.context.task, still.positions, still)
    k = len(first.times) // 3
    dt = first.times[1]
    moving = Setpoint(
        first.positions[k], first.velocities[k], (first.velocities[k + 1] - first.velocities[k - 1]) / (2 * dt), goal
    )
    onward = to_rest(here, moving, step(here, begin(here), 2 * ACTION).goal)
    np.testing.assert_allclose(onward.velocities[0], moving.velocities, atol=1e-6)
    check_trajectory_limits(here, onward, cell.context.task, moving.positions, moving)
    with pytest.raises(MotionError) as error:
        check_trajectory_limits(here, onward, cell.context.task, moving.positions)
    assert error.value.detail["why"] == "rate"


def test_a_target_the_arm_cannot_reach_in_time_is_refused(cell, spec):
    here = ArmModel(cell.arm)
    far = np.array(spec.home)
    far[0] += 1.2 * MOST_LAG * spec.limits[0].velocity
    with pytest.raises(MotionError) as error:
        to_rest(here, cell.arm.setpoint(), far)
    assert error.value.detail["why"] == "rate" and error.value.detail["behind_s"] > MOST_LAG


def test_an_action_towards_another_arm_is_refused_near_it(cell, spec):
    other = IdealArm(spec, NEAR)
    cell.context.cell.arms = [cell.arm, other]
    start, end = (a.state().ee_pose.position.array for a in (cell.arm, other))
    way = cell.arm.base_pose.rotation.rotation.inv().apply(end - start)
    action = [*(way / np.abs(way).max()), 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(MotionError) as error:
        for _ in range(20):
            cell.call("robot_control.ApplyPolicyAction", action=action)
    assert error.value.detail["why"] == "arms_meet"
