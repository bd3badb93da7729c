"""A stop takes no longer and no farther than the robot's limits say."""

from __future__ import annotations

import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain
from gap_control.stop_trajectory import stop_bounds
from gap_motion.timing.timing import point_to_point
from gap_runtime.contracts.failures import MotionError

pytestmark = pytest.mark.sim
AT_REST = 0.03  # rad/s: as the end of a motion is judged
SERVO = 0.03  # s: what measured joints need beyond their set-points to be still
SPAN = 1.2  # rad: far enough for every joint to reach its full speed


def sweeps(spec):
    """The fastest motions there are, well above the floor: each joint alone, then all of them together."""
    home = np.array(spec.home)
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    height = {sign: chain(spec).tcp_poses(home + sign * SPAN * np.eye(spec.dof))[:, 2, 3] for sign in (1, -1)}
    way = np.where(height[1] > height[-1], SPAN, -SPAN)
    ways = [row * way for row in np.eye(spec.dof)[: spec.dof - 1]] + [way * np.arange(spec.dof) / spec.dof, way / 2]
    return [point_to_point(chain(spec), np.stack([home, np.clip(home + w, low, high)])) for w in ways]


@pytest.mark.parametrize("robot", ["panda", "ur5e"])
def test_the_fastest_motions_stop_within_the_stated_time_and_travel(cell_of, robot):
    world = cell_of(robot)
    arm, controller, seen = world.arms[0], world.arms[0].controller, []
    bound, step = stop_bounds(arm.spec), world._scene.model.opt.timestep
    world._physics.observers.append(lambda: seen.append((controller.positions.copy(), controller.velocities.copy())))
    fastest = 0.0
    for way in sweeps(arm.spec):
        for share in (0.15, 0.5, 0.7):
            world.reset(world.sample(1))
            arm.start(way)
            world.wait(share * way.duration)
            np.testing.assert_allclose(arm.setpoint().goal, way.positions[-1])  # on its way: it has met nothing
            told = len(seen) - 1
            arm.stop()
            world.wait(bound.time + SERVO)
            rows, speeds = (np.array(part) for part in zip(*seen[told:], strict=True))
            fastest = max(fastest, (np.abs(speeds[0]) / [x.velocity for x in arm.spec.limits]).max())
            still = np.abs(speeds).max(axis=1) < AT_REST
            assert still[-1] and np.flatnonzero(~still).max(initial=0) * step <= bound.time + SERVO
            assert (np.abs(rows - rows[0]).max(axis=0) <= bound.travel).all()
    world._physics.observers.clear()
    assert fastest > 0.9  # of a joint's speed limit: these were fast


def test_a_command_under_way_ends_with_the_stop(cell_of):
    world = cell_of("panda")
    arm = world.arms[0]
    world._physics.observers.append(lambda: arm.stop() if 0.2 < world.time < 0.205 else None)
    with pytest.raises(MotionError) as stop:
        arm.execute(sweeps(arm.spec)[0])
    world._physics.observers.clear()
    assert stop.value.code == "stopped" and world.time < 0.2 + stop_bounds(arm.spec).time + SERVO
