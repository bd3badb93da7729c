"""One harness for the arms of every world: a motion that is started goes on while world time passes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gap_runtime.contracts.task import load_task
from gap_runtime.contracts.types import Trajectory
from gap_runtime.testing import FakeCell

TASK = Path(__file__).parents[2] / "tasks" / "fulfill-grocery"
LONG = 1.0  # s


def simulated():
    from gap_mujoco.simulator import MujocoSimulator
    from gap_robots.panda import panda

    return MujocoSimulator(load_task(TASK, "object"), "milk", {"panda": panda()})


@pytest.fixture(scope="module", params=[FakeCell, pytest.param(simulated, marks=pytest.mark.sim)])
def made(request):
    world = request.param()
    yield world
    world.close()


@pytest.fixture
def world(made):
    made.reset(made.sample(1))
    return made


def turn(arm, by=0.2):
    """A smooth turn of the first joint."""
    s = np.linspace(0, 1, 101)[:, None]
    way = np.eye(arm.spec.dof)[0] * by
    smooth, slope = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2
    return Trajectory(s[:, 0] * LONG, arm.state().joints.positions + smooth * way, slope * way / LONG)


def gone(arm, way):
    """How much of a turn is done."""
    start, end = way.positions[[0, -1], 0]
    return (arm.state().joints.positions[0] - start) / (end - start)


def test_starting_takes_no_time_and_finishing_takes_what_is_left(world):
    arm, began = world.arms[0], world.time
    way = turn(arm)
    arm.start(way)
    assert world.time == began and gone(arm, way) == pytest.approx(0, abs=0.01)
    world.wait(LONG / 2)
    assert 0.4 < gone(arm, way) < 0.6
    np.testing.assert_allclose(arm.setpoint().goal, way.positions[-1], atol=1e-9)
    arm.finish()
    assert gone(arm, way) == pytest.approx(1, abs=0.01) and world.time == pytest.approx(began + LONG, abs=0.05)
    arm.finish()
    np.testing.assert_allclose(arm.setpoint().goal, arm.setpoint().positions)


def test_jaws_take_the_arm_along(world):
    arm = world.arms[0]
    way = turn(arm)
    arm.start(way)
    arm.gripper.set_width(0.0, settle=0.5)
    assert gone(arm, way) > 0.3
    arm.finish()


def test_jaws_need_not_be_waited_for(world):
    arm, began = world.arms[0], world.time
    arm.gripper.set_width(0.0, wait=False)
    assert world.time == began
    world.wait(1.5)
    assert arm.state().gripper.width < 0.001


def test_a_gripper_says_that_it_holds_nothing_wherever_it_stands(world):
    gripper = world.arms[0].gripper
    for state in (gripper.open(), gripper.set_width(0.02), gripper.close(), gripper.set_force(5.0)):
        assert state.holding is False and -1e-3 <= state.width <= gripper.spec.max_width + 1e-3
    assert gripper.state() == world.arms[0].state().gripper


def test_the_next_motion_lets_the_one_under_way_end(world):
    arm, began = world.arms[0], world.time
    first = turn(arm)
    arm.start(first)
    back = Trajectory(first.times, first.positions[::-1], -first.velocities[::-1])
    arm.execute(back)
    assert gone(arm, first) == pytest.approx(0, abs=0.02) and world.time > began + 1.95 * LONG


def test_stop_and_reset_end_what_was_started(world):
    arm = world.arms[0]
    for end in (arm.stop, lambda: world.reset(world.sample(1))):
        way = turn(arm)
        arm.start(way)
        world.wait(LONG / 4)
        end()
        world.wait(2 * LONG)
        assert gone(arm, way) < 0.9
        arm.finish()
