"""Planners keep the TCP where commands may take it."""

from __future__ import annotations

import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain
from gap_motion.planning.planning_scene import PlanningScene
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Se3Pose, Trajectory, Vec3, WorldConfig
from tests.unit.motion.conftest import ALONE


@pytest.fixture
def box(cell):
    """A workspace around the TCP, `sides` [m] to each side; returns where the TCP is."""

    def around(*sides):
        p = cell.arm.state().ee_pose.position.array
        low, high = p - np.array(sides), p + np.array(sides)
        cell.context.task.environment.workspace = (tuple(low), tuple(high))
        return p

    return around


def shifted(cell, *by):
    pose = cell.arm.state().ee_pose
    return Se3Pose(Vec3.of(pose.position.array + by), pose.rotation)


def plan(cell, target):
    start = cell.arm.state().joints
    return cell.call("curobo.PlanToPose", target_pose=target, start_joint_position=start).trajectory


def tcp(cell, trajectory):
    return chain(cell.arm.spec).tcp_poses(trajectory.positions, cell.arm.base_pose.matrix)[:, :3, 3]


def test_a_planned_motion_stays_inside(cell, box):
    by = np.array([-0.15, 0.35, 0.0])
    p = box(1.0, 1.0, 1.0)
    beyond = tcp(cell, plan(cell, shifted(cell, *by))) - p - np.maximum(by, 0.0)
    axis = int(beyond.max(axis=0).argmax())
    wall = p + np.maximum(by, 0.0) + np.where(np.arange(3) == axis, beyond[:, axis].max() / 2, 1.0)
    assert beyond[:, axis].max() > 0.01, "else nothing is shown"
    cell.context.task.environment.workspace = (tuple(p - 1.0), tuple(wall))
    assert (tcp(cell, plan(cell, shifted(cell, *by))) < wall + 0.001).all()


def test_a_goal_outside_is_said_to_be(cell, box):
    box(0.05, 0.05, 0.05)
    with pytest.raises(PlanningError, match="edge of the workspace"):
        plan(cell, shifted(cell, 0.0, 0.0, -0.1))


def test_from_outside_it_may_come_back_and_not_go_farther(cell, box):
    p = box(0.05, 0.05, 0.05)
    cell.context.task.environment.workspace = (tuple(p + 0.01), tuple(p + 0.2))
    assert len(plan(cell, shifted(cell, 0.05, 0.05, 0.05)).times) > 2
    with pytest.raises(PlanningError, match="edge of the workspace"):
        plan(cell, shifted(cell, -0.05, 0.0, 0.0))


def test_a_trajectory_that_leaves_it_is_told_with_the_waypoint(cell, box):
    box(0.3, 0.3, 0.3)
    made = plan(cell, shifted(cell, 0.0, 0.1, 0.0))
    ask = {"world_config": WorldConfig(()), "trajectory": Trajectory(made.times, made.positions)}
    assert cell.call("curobo.ValidateJointTrajectoryRobot", **ask).success
    box(0.05, 0.05, 0.05)
    verdict = cell.call("curobo.ValidateJointTrajectoryRobot", **ask)
    path = np.abs(tcp(cell, made) - cell.arm.state().ee_pose.position.array).max(axis=1)
    assert not verdict.success and "edge of the workspace" in verdict.failure_reason
    assert verdict.first_collision_waypoint == int((path > 0.0505).argmax())


def test_one_check_and_many_agree(cell, box):
    box(0.1, 0.1, 0.1)
    start = cell.arm.state().joints.positions
    checker = PlanningScene.of(cell.context, ALONE).checker(start)
    q = start + np.random.default_rng(0).normal(0.0, 0.15, (50, len(start)))
    valid = checker.valid(q)
    assert valid.any() and not valid.all()
    assert [checker.free(row) for row in q] == valid.tolist() == [checker.first_contact(row) is None for row in q]
