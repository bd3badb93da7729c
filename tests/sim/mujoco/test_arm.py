"""Arms: they follow what they can, refuse what they must not, and say why they stopped."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from gap_control.point_to_point import point_to_point
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Trajectory

pytestmark = pytest.mark.sim


def swing(arm, joint=0, by=0.5):
    """A jerk-limited move of one joint."""
    start = arm.state().joints.positions
    goal = start.copy()
    goal[joint] += by
    return point_to_point(arm.spec, start, goal)


def test_a_trajectory_is_tracked_within_limits(world):
    arm, speeds, torques, lags = world.arms[0], [], [], []
    controller = world.arms[0].controller

    def look():
        speeds.append(np.abs(controller.velocities))
        torques.append(np.abs(controller.state().joints.efforts))
        lags.append(np.abs(controller.positions - controller.target).max())

    world._physics.observers.append(look)
    trajectory = swing(arm)
    began = world.time
    arm.execute(trajectory, tolerance=0.005)
    world._physics.observers.clear()
    assert np.abs(arm.state().joints.positions - trajectory.positions[-1]).max() < 0.005
    assert world.time - began == pytest.approx(trajectory.duration, abs=0.1)
    assert (np.max(speeds, axis=0) <= [j.velocity for j in arm.spec.limits]).all()
    assert (np.max(torques, axis=0) <= [j.torque for j in arm.spec.limits]).all()
    assert max(lags) < 0.01


def bad(arm, kind):
    good = swing(arm)
    times, positions, velocities = good.times.copy(), good.positions.copy(), good.velocities.copy()
    if kind == "not finite":
        positions[3, 2] = np.nan
    elif kind == "starts":
        positions += 0.05
    elif kind == "leave its range":
        positions[-1, 3] = 0.5
    elif kind == "rad/s":
        times, velocities = times / 20, velocities * 20
    elif kind == "joints":
        positions, velocities = positions[:, :6], velocities[:, :6]
    elif kind == "times":
        times[5] = times[4]
    elif kind == "lasts":
        times = times * 1e3
    return Trajectory(times, positions, velocities)


@pytest.mark.parametrize("kind", ["not finite", "starts", "leave its range", "rad/s", "joints", "times", "lasts"])
def test_a_bad_command_is_refused_whole(world, kind):
    arm, before = world.arms[0], world._physics.data.qpos.copy()
    with pytest.raises(MotionError, match=kind) as refusal:
        arm.execute(bad(arm, kind))
    assert refusal.value.code == "refused"
    assert world.time == 0 and np.array_equal(world._physics.data.qpos, before)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan")])
def test_a_tolerance_nothing_can_hold_is_refused(world, tolerance):
    with pytest.raises(MotionError, match="tolerance"):
        world.arms[0].execute(swing(world.arms[0]), tolerance=tolerance)


def test_velocities_may_be_left_out(world):
    arm = world.arms[0]
    smooth = swing(arm)
    arm.execute(Trajectory(smooth.times, smooth.positions))
    assert np.allclose(arm.state().joints.positions, smooth.positions[-1], atol=0.01)


def test_a_single_point_is_held(world):
    arm = world.arms[0]
    here = arm.state().joints.positions
    arm.execute(Trajectory([0.0], [here]))
    assert np.allclose(arm.state().joints.positions, here, atol=0.001)


def test_driving_into_the_floor_is_a_contact(world, move_to):
    move_to(world, [-0.3, 0.12, 0.10])
    with pytest.raises(MotionError) as stop:
        move_to(world, [-0.3, 0.12, -0.10])
    assert stop.value.code == "contact" and stop.value.detail["value"] > stop.value.detail["limit"]
    world.wait(0.3)
    assert np.abs(world.arms[0].state().joints.velocities).max() < 0.01


def test_a_weak_arm_reports_that_it_cannot_follow(world):
    model, controller = world._scene.model, world.arms[0].controller
    strong = model.actuator_forcerange.copy()
    model.actuator_forcerange[controller._u] = [-0.5, 0.5]
    try:
        with pytest.raises(MotionError) as stop:
            world.arms[0].execute(swing(world.arms[0], by=1.0))
    finally:
        model.actuator_forcerange[:] = strong
    assert stop.value.code == "tracking"


def test_an_arm_that_is_held_short_of_its_goal_is_stalled(world):
    model, arm = world._scene.model, world.arms[0]
    joint = model.joint("arm0/panda_joint7")
    free = joint.range.copy()
    start = arm.state().joints.positions
    joint.range[1] = start[6] + 0.02  # a stop that the robot's file does not know of
    goal = start.copy()
    goal[6] += 0.06
    try:
        with pytest.raises(MotionError) as stop:
            arm.execute(point_to_point(arm.spec, start, goal))
    finally:
        joint.range[:] = free
    assert stop.value.code in ("stalled", "contact") and "panda_joint7" in stop.value.message


def test_stop_from_another_thread_ends_the_motion_and_only_that(world):
    arm, begun = world.arms[0], threading.Event()
    world._physics.observers.append(lambda: begun.set() if world.time > 0.3 else None)

    def stopper():
        begun.wait(10)
        arm.stop()
        arm.stop()

    helper = threading.Thread(target=stopper)
    helper.start()
    goal = swing(arm, by=2.0)
    with pytest.raises(MotionError) as stop:
        arm.execute(goal)
    helper.join()
    world._physics.observers.clear()
    assert stop.value.code == "stopped"
    halted = arm.state().joints
    assert np.abs(halted.velocities).max() < 0.05
    assert abs(halted.positions[0] - goal.positions[-1, 0]) > 0.1
    world.wait(0.2)
    assert np.allclose(arm.state().joints.positions, halted.positions, atol=0.01)
    arm.execute(swing(arm, by=-0.1))


def test_stop_brakes_within_the_acceleration_limits(world):
    arm, speeds = world.arms[0], []
    controller = world.arms[0].controller

    def look():
        speeds.append(controller.velocity.copy())
        if len(speeds) == 200:
            arm.stop()

    world._physics.observers.append(look)
    with pytest.raises(MotionError):
        arm.execute(swing(arm, by=2.0))
    world._physics.observers.clear()
    acceleration = np.abs(np.diff(speeds, axis=0)) / world._scene.model.opt.timestep
    assert (acceleration.max(axis=0) <= np.array([j.acceleration for j in arm.spec.limits]) * 1.01).all()


def test_a_stop_before_a_command_does_not_touch_it(world):
    arm = world.arms[0]
    arm.stop()
    arm.execute(swing(arm, by=0.05))


def test_jaws_go_where_they_are_told_at_their_speed(world):
    arm = world.arms[0]
    for width in (0.03, 0.0, 0.08):
        began, from_width = world.time, arm.state().gripper.width
        state = arm.gripper.set_width(width, settle=0.1)
        assert state.width == pytest.approx(width, abs=0.001)
        assert state.fraction == pytest.approx(width / 0.08, abs=0.02)
        assert world.time - began >= abs(width - from_width) / arm.spec.gripper.max_speed


@pytest.mark.parametrize(("width", "force"), [(-0.01, None), (0.2, None), (float("nan"), None), (0.02, 0), (0.02, 1e3)])
def test_jaws_refuse_what_the_gripper_cannot_do(world, width, force):
    with pytest.raises(MotionError) as refusal:
        world.arms[0].gripper.set_width(width, force=force)
    assert refusal.value.code == "refused" and world.time == 0


def test_two_arms_share_one_cell(task, robots):
    from gap_mujoco.simulator import MujocoSimulator
    from gap_runtime.contracts.task import RobotPlacement

    across = RobotPlacement(model="panda", position=(0.6, 0.0, 0.0), yaw_deg=180)
    world = MujocoSimulator(task.model_copy(update={"robots": [task.robots[0], across]}), "milk", robots)
    world.reset(world.sample(0))
    left, right = world.arms
    assert world.camera_names == ("agentview", "wrist_0", "wrist_1")
    right.execute(swing(right))
    right.gripper.set_width(0.02)
    assert np.allclose(left.state().joints.positions, left.spec.home, atol=1e-3)
    assert left.state().gripper.width > 0.079 and right.state().gripper.width < 0.021
    p, q = (arm.state().ee_pose.position.array for arm in (left, right))
    assert p[0] < 0 < q[0]
    world.close()
