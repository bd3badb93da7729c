"""Commands over any joint controller: they end where they should, one after the other or together, and fail aloud."""

from __future__ import annotations

import numpy as np
import pytest

from gap_control.motion_executor import Command, execute, start
from gap_control.point_to_point import point_to_point
from gap_runtime.contracts.failures import MotionError


def turn(arm, by=0.5, stopped=lambda: False):
    """A command that turns the first joint."""
    here = arm.controller.target
    way = point_to_point(arm.controller.spec, here, here + by * np.eye(len(here))[0])
    return Command(arm.executor, way, 0.01, stopped)


def at(arm, command):
    return np.allclose(arm.controller.positions, command.trajectory.positions[-1], atol=1e-6)


def test_a_command_ends_where_and_when_its_trajectory_does(make_arm, clock):
    arm = make_arm()
    command = turn(arm)
    clock.run(execute([command]))
    assert at(arm, command) and clock.time == pytest.approx(command.trajectory.duration, abs=0.01)


def test_arms_move_together(make_arm, clock):
    pair = [make_arm(), make_arm()]
    commands = [turn(arm, by) for arm, by in zip(pair, (0.5, -0.2), strict=True)]
    clock.run(execute(commands))
    assert all(map(at, pair, commands))
    assert clock.time == pytest.approx(max(c.trajectory.duration for c in commands), abs=0.01)


def test_when_one_arm_is_blocked_all_stop(make_arm, clock):
    free, blocked = make_arm(), make_arm(wall=0.1)
    commands = [turn(free, 1.0), turn(blocked, 1.0)]
    with pytest.raises(MotionError) as stop:
        clock.run(execute(commands))
    assert stop.value.code == "contact" and stop.value.detail["joint"] == "panda_joint1"
    assert not at(free, commands[0]) and np.abs(free.controller.applied.velocities).max() < 1e-9
    assert blocked.controller.external_torque.max() < blocked.controller.contact_torque.max()


def test_a_started_command_goes_on_with_the_clock_and_its_failure_is_raised_by_the_next(make_arm, clock):
    arm = make_arm(wall=0.1)
    clock.run(start(turn(arm), replace=False))
    assert clock.time == 0 and arm.executor.setpoint().goal[0] == pytest.approx(0.5)
    for _ in range(500):
        clock.step()
    with pytest.raises(MotionError, match=r"started at 0\.00 s") as error:
        clock.run(execute([turn(arm)]))
    assert error.value.code == "contact"
    clock.run(arm.executor.finish())


def test_a_stop_brings_the_arm_to_rest_inside_its_limits(make_arm, clock):
    arm, speeds = make_arm(), []
    command = turn(arm, 2.0, stopped=lambda: clock.time > 0.4)
    clock.run(start(command, replace=False))
    while not arm.executor.motion.done:
        clock.step()
        speeds.append(arm.controller.applied.velocities[0])
    clock.run(arm.executor.finish())  # a motion that was told to stop has not failed
    limit = arm.controller.spec.limits[0].acceleration
    assert (
        not at(arm, command)
        and abs(speeds[-1]) < 1e-9
        and np.abs(np.diff(speeds)).max() <= limit * clock.period * 1.001
    )


def test_a_lag_is_told(make_arm, clock):
    arm = make_arm(wall=0.1, stiffness=0.0)
    with pytest.raises(MotionError) as stop:
        clock.run(execute([turn(arm)]))
    assert stop.value.code == "tracking"


def test_an_arm_held_short_of_its_goal_is_stalled(make_arm, clock):
    arm = make_arm(wall=0.45, stiffness=0.0)
    with pytest.raises(MotionError) as stop:
        clock.run(execute([turn(arm)]))
    assert stop.value.code == "stalled"
