"""Motions that are started and not waited for: they go on while world time passes, and their failures are not lost."""

from __future__ import annotations

import numpy as np
import pytest

from gap_control.point_to_point import point_to_point
from gap_runtime.contracts.failures import MotionError

pytestmark = pytest.mark.sim


def swing(arm, by=0.5, joint=0):
    start = arm.state().joints.positions
    goal = start.copy()
    goal[joint] += by
    return point_to_point(arm.spec, start, goal)


def at(arm, trajectory, atol=2e-3):
    return np.allclose(arm.state().joints.positions, trajectory.positions[-1], atol=atol)


def test_a_started_motion_takes_no_time_and_goes_on_when_time_passes(world):
    arm = world.arms[0]
    way = swing(arm)
    home = arm.state().joints.positions
    arm.start(way)
    assert world.time == 0 and np.array_equal(arm.state().joints.positions, home)
    world.wait(way.duration / 2)
    halfway = world.observe([]).arm_states[0].joints
    assert np.allclose(halfway.positions, (home + way.positions[-1]) / 2, atol=5e-3) and halfway.velocities[0] > 0.5
    assert np.array_equal(arm.setpoint().goal, way.positions[-1])
    world.wait(way.duration / 2)
    assert at(arm, way)


def test_jaws_and_arm_move_at_the_same_time(world):
    arm = world.arms[0]
    way = swing(arm, 1.0)
    arm.start(way)
    arm.gripper.set_width(0.0, settle=0.0)
    closed = world.time
    assert arm.state().joints.velocities[0] > 0.1
    arm.finish()
    assert at(arm, way) and arm.state().gripper.width < 0.001
    assert world.time < closed + way.duration
    world.reset(world.sample(1))
    arm.execute(swing(arm, 1.0))
    arm.gripper.set_width(0.0, settle=0.0)
    apart = world.time
    assert apart == pytest.approx(closed + way.duration, abs=0.1)


def test_the_next_motion_waits_for_the_one_under_way(world):
    arm = world.arms[0]
    first = swing(arm)
    arm.start(first)
    back = point_to_point(arm.spec, first.positions[-1], np.array(arm.spec.home))
    arm.execute(back)
    assert at(arm, back) and world.time > first.duration + back.duration - 0.01


def test_finishing_where_nothing_is_under_way_takes_no_time(world):
    world.arms[0].finish()
    assert world.time == 0


def test_a_bad_command_is_refused_when_it_is_started(world):
    arm = world.arms[0]
    way = swing(arm)
    with pytest.raises(MotionError) as refusal:
        arm.start(type(way)(way.times / 50, way.positions, way.velocities * 50))
    assert refusal.value.code == "refused"
    world.wait(0.1)
    assert np.allclose(arm.state().joints.positions, arm.spec.home, atol=1e-3)


@pytest.fixture
def failed(world, move_to, reach_to):
    """A world whose arm has met the floor on a motion that nobody waited for."""
    arm = world.arms[0]
    move_to(world, [-0.3, 0.12, 0.10])
    arm.start(point_to_point(arm.spec, arm.state().joints.positions, reach_to(world, np.array([-0.3, 0.12, -0.10]))))
    began = world.time
    world.wait(1.5)
    return world, began


@pytest.mark.parametrize("command", ["execute", "start", "finish", "set_width"])
def test_a_failure_is_raised_by_the_arms_next_command_and_once(failed, command):
    world, began = failed
    arm = world.arms[0]
    here = world.time
    do = {
        "execute": lambda: arm.execute(swing(arm)),
        "start": lambda: arm.start(swing(arm)),
        "finish": arm.finish,
        "set_width": lambda: arm.gripper.set_width(0.0),
    }[command]
    with pytest.raises(MotionError) as error:
        do()
    assert error.value.code == "contact" and error.value.detail["started_s"] == pytest.approx(began)
    assert f"{began:.2f} s" in error.value.message and world.time == here
    arm.finish()


def test_stop_ends_what_was_started_and_forgets_its_failure(failed, world, move_to):
    arm = world.arms[0]
    arm.stop()
    arm.finish()
    assert np.abs(arm.state().joints.velocities).max() < 0.01
    move_to(world, [-0.3, 0.12, 0.15])


def test_stop_brakes_an_arm_under_way_once_time_passes(world):
    arm = world.arms[0]
    way = swing(arm, 1.5)
    arm.start(way)
    world.wait(0.5)
    arm.stop()
    world.wait(0.5)
    rest = arm.state().joints
    assert np.abs(rest.velocities).max() < 0.01 and not at(arm, way, 0.1)
    arm.execute(swing(arm, -0.1))


def test_a_new_episode_knows_nothing_of_what_was_under_way(world):
    arm = world.arms[0]
    arm.start(swing(arm))
    world.wait(0.2)
    world.reset(world.sample(1))
    world.wait(0.5)
    assert np.allclose(arm.state().joints.positions, arm.spec.home, atol=1e-3)


def test_a_replacement_goes_on_from_the_motion_under_way(world):
    arm, speeds = world.arms[0], []
    controller = world.arms[0].controller
    arm.start(swing(arm, 1.0))
    world.wait(0.4)
    with pytest.raises(MotionError, match="starts at"):
        arm.start(swing(arm, 0.1), replace=True)
    now = arm.setpoint()
    t = np.linspace(0, 1, 201)[:, None]
    onward = now.positions + now.velocities * (t - t**2 + t**3 / 3)  # slows down evenly to rest
    world._physics.observers.append(lambda: speeds.append(controller.velocity.copy()))
    arm.start(type(swing(arm))(t[:, 0], onward, now.velocities * (1 - t) ** 2), replace=True)
    arm.finish()
    world._physics.observers.clear()
    assert np.abs(np.diff(speeds, axis=0)).max() < 0.03 and np.allclose(speeds[0], now.velocities, atol=0.03)
    assert np.allclose(arm.state().joints.positions, onward[-1], atol=2e-3)


def test_a_failure_that_is_known_is_told_even_before_the_arm_is_at_rest(world, move_to, reach_to):
    arm = world.arms[0]
    move_to(world, [-0.3, 0.12, 0.10])
    arm.start(point_to_point(arm.spec, arm.state().joints.positions, reach_to(world, np.array([-0.3, 0.12, -0.10]))))
    motion = arm.executor.motion
    while not motion.failure:
        world.wait(0.002)
    assert not motion.done
    with pytest.raises(MotionError, match="contact"):
        arm.gripper.set_width(0.0)
    assert arm.state().gripper.width > 0.079 and np.abs(arm.state().joints.velocities).max() < 0.1
