"""A stop takes no longer and no farther than the robot's limits say."""

from __future__ import annotations

import numpy as np
import pytest

from gap_catalogue.shared.robot_chain import chain
from gap_motion.timing.timing import point_to_point
from gap_mujoco.control.stop_trajectory import braking, stopping
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
    arm, drive, seen = world.arms[0], world._drives[0], []
    bound, step = stopping(arm.spec), world._scene.model.opt.timestep
    world._physics.observers.append(lambda: seen.append((drive.positions.copy(), drive.velocities.copy())))
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


@pytest.mark.parametrize("robot", ["panda", "ur5e"])
def test_braking_keeps_every_limit_and_the_stated_bounds(cell_of, robot):
    spec = cell_of(robot).arms[0].spec
    low, high, v, a, j = (
        np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper", "velocity", "acceleration", "jerk")
    )
    rng, dt, bound = np.random.default_rng(0), 0.002, stopping(spec)
    for _ in range(50):
        q, dq, ddq = (low + high) / 2, v * rng.uniform(-1, 1, spec.dof), a * rng.uniform(-1, 1, spec.dof)
        rows = braking(spec, q, dq, ddq)
        assert len(rows.positions) * dt <= bound.time + dt and np.abs(rows.velocities[-1]).max() < 1e-9
        assert (np.abs(rows.positions - q).max(axis=0) <= bound.travel).all()
        speeds = np.concatenate([[dq], rows.velocities])
        assert (np.abs(np.diff(speeds, axis=0)).max(axis=0) / dt <= a * 1.001).all()
        assert (np.abs(np.diff(speeds, 2, axis=0)).max(axis=0) / dt**2 <= j * 1.001).all()


def test_a_joint_about_to_meet_its_limit_stops_before_it(cell_of):
    spec = cell_of("panda").arms[0].spec
    first, second = spec.limits[0], spec.limits[1]
    q, dq = np.array(spec.home), np.zeros(spec.dof)
    dq[0], dq[1] = 1.0, second.velocity  # the second joint takes longer to stop
    q[0] = first.upper - 1.1 * (1.0 / (2 * first.acceleration))
    rows = braking(spec, q, dq, np.zeros(spec.dof))
    assert rows.positions[:, 0].max() <= first.upper


def test_an_arm_at_rest_has_nothing_to_brake(cell_of):
    spec = cell_of("panda").arms[0].spec
    assert len(braking(spec, np.array(spec.home), np.zeros(spec.dof), np.zeros(spec.dof)).positions) == 0


def test_a_command_under_way_ends_with_the_stop(cell_of):
    world = cell_of("panda")
    arm = world.arms[0]
    world._physics.observers.append(lambda: arm.stop() if 0.2 < world.time < 0.205 else None)
    with pytest.raises(MotionError) as stop:
        arm.execute(sweeps(arm.spec)[0])
    world._physics.observers.clear()
    assert stop.value.code == "stopped" and world.time < 0.2 + stopping(arm.spec).time + SERVO
