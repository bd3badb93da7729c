"""The world as a whole: episodes begin alike, nothing is teleported, and ground truth stays out of policies' reach."""

from __future__ import annotations

import logging
import threading
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from gap_mujoco.simulator import MujocoSimulator
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.failures import (
    BadRequestError,
    GapError,
    PrivilegedReadError,
    SimulationDivergedError,
    TaskInfeasibleError,
    UnknownNameError,
)
from gap_runtime.contracts.types import Se3Pose, Vec3

pytestmark = pytest.mark.sim


def state_bytes(world):
    data = world._physics.data
    return data.qpos.tobytes() + data.qvel.tobytes()


def test_a_reset_leaves_everything_at_rest_where_the_instance_says(world):
    instance, now = world.sample(1), world.snapshot()
    assert now.time == 0 and now.start is not None
    for name, pose in instance.poses.items():
        body = now.body(name)
        assert body.is_settled() and body.touches("floor") and body.is_released()
        assert np.linalg.norm(now.bodies[name].pose.position.array - pose.position.array) < 0.001
    arm = world.arms[0]
    assert np.allclose(arm.state().joints.positions, arm.spec.home, atol=1e-3)
    assert arm.state().gripper.width == pytest.approx(arm.spec.gripper.max_width, abs=1e-3)


def test_equal_episodes_are_equal_to_the_byte(make_world, task, robots, move_to):
    def episode(world):
        world.reset(world.sample(5))
        move_to(world, [-0.12, -0.24, 0.2])
        world.arms[0].gripper.set_width(0.02, settle=0.1)
        frame = world.observe(["wrist"]).cameras[0]
        return state_bytes(world) + frame.rgb.data.tobytes() + frame.depth.data.tobytes()

    used, fresh = make_world(), MujocoSimulator(task, "alphabet_soup", robots)
    used.reset(used.sample(2))
    used.wait(0.1)
    assert episode(used) == episode(fresh)
    fresh.close()


def test_every_change_of_position_is_velocity_times_time(world, move_to):
    physics, checked = world._physics, []
    before = physics.data.qpos.copy()

    def compare():
        nonlocal before
        mujoco.mj_integratePos(physics.model, before, physics.data.qvel, physics.model.opt.timestep)
        checked.append(np.abs(before - physics.data.qpos).max())
        before = physics.data.qpos.copy()

    physics.observers.append(compare)
    soup = world.snapshot().bodies["alphabet_soup"].pose.position.array
    move_to(world, np.add(soup, [0, 0, 0.15]))
    move_to(world, soup)
    world.arms[0].gripper.set_width(0.0)
    move_to(world, np.add(soup, [0, 0, 0.15]))
    physics.observers.remove(compare)
    assert world.snapshot().body("alphabet_soup").lifted() > 0.1
    assert len(checked) > 500 and max(checked) < 1e-12


def test_nothing_is_welded_to_anything(world):
    model = world._scene.model
    allowed = {mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_TENDON}
    assert {mujoco.mjtEq(int(t)) for t in model.eq_type} <= allowed


def test_a_policy_node_cannot_reach_ground_truth(world):
    frames = []
    with node_scope("grasp/close"):
        for forbidden in (world.snapshot, lambda: world.sample(0), lambda: world.reset(None)):
            with pytest.raises(PrivilegedReadError, match="grasp/close"):
                forbidden()
        world.observe([])
        stop = world.subscribe(frames.append, 50)
    world.wait(0.04)
    stop()
    assert frames and all(f.snapshot is None for f in frames)


def test_listeners_hear_world_time_at_their_rate_and_change_nothing(world):
    instance, times = world.sample(1), []

    def listener(frame):
        times.append(frame.time)
        assert frame.snapshot is not None and frame.observation.arm_states

    stop = world.subscribe(listener, 20)
    world.reset(instance)
    world.wait(0.5)
    stop()
    heard = state_bytes(world)
    world.wait(0.1)
    assert np.allclose(np.diff(times), 0.05, atol=0.003) and len(times) == 11
    world.reset(instance)
    world.wait(0.5)
    assert state_bytes(world) == heard


@pytest.mark.parametrize("damage", ["position", "velocity", "clock"])
def test_a_simulation_that_blows_up_voids_the_episode(world, damage):
    data = world._physics.data
    if damage == "position":
        data.qpos[-3] = np.nan
    elif damage == "velocity":
        data.joint("milk/").qvel[:] = 1e4
    else:
        world._physics.observers.append(lambda: setattr(data, "time", 0.0))
    try:
        with pytest.raises(SimulationDivergedError):
            world.wait(0.1)
    finally:
        world._physics.observers.clear()
    world.reset(world.sample(1))
    world.wait(0.1)


def test_a_warning_goes_to_the_log_and_to_no_file(world, tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    world._physics.data.qpos[-3] = np.nan
    with caplog.at_level(logging.WARNING), pytest.raises(SimulationDivergedError):
        world.wait(0.1)
    assert "Nan" in caplog.text and not list(tmp_path.iterdir())


def test_an_instance_that_does_not_stand_is_refused(world):
    instance = world.sample(1)
    floating = Se3Pose(Vec3(0.0, 0.0, 0.3), instance.poses["milk"].rotation)
    with pytest.raises(TaskInfeasibleError, match="'milk' in region slot_d does not stay"):
        world.reset(replace(instance, poses={**instance.poses, "milk": floating}))


def test_what_is_in_the_way_of_an_object_is_named(world):
    instance = world.sample(1)
    inside = replace(instance.poses["milk"], position=instance.poses["tomato_sauce"].position)
    with pytest.raises(TaskInfeasibleError, match=r"in region slot_. .* is in its way. In 100 of 100 draws"):
        world.reset(replace(instance, poses={**instance.poses, "milk": inside}))
    with pytest.raises(GapError, match="empty"):
        world.snapshot()
    world.reset(instance)


def test_an_instance_of_another_scene_is_refused(world):
    instance = world.sample(1)
    with pytest.raises(BadRequestError, match="milk"):
        world.reset(replace(instance, poses={k: v for k, v in instance.poses.items() if k != "milk"}))


def test_an_empty_world_says_so(task, robots):
    world = MujocoSimulator(task, "milk", robots)
    for attempt in (
        world.observe,
        world.snapshot,
        lambda: world.wait(1),
        lambda: world.arms[0].gripper.set_width(0.01),
    ):
        with pytest.raises(GapError, match="until it is reset"):
            attempt()
    world.close()
    world.close()


def test_any_thread_may_call(world):
    found = []
    threads = [threading.Thread(target=lambda: found.append(world.observe(["agentview"]))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 3 and all(f.cameras[0].rgb == found[0].cameras[0].rgb for f in found)


def test_unknown_names_and_durations_are_refused(world, task, robots):
    with pytest.raises(UnknownNameError, match="agentviewer"):
        world.observe(["agentviewer"])
    with pytest.raises(UnknownNameError, match="nose"):
        world.camera_pose("nose")
    with pytest.raises(UnknownNameError, match="robot 'panda'"):
        MujocoSimulator(task, "milk", {})
    with pytest.raises(BadRequestError):
        world.wait(float("nan"))
    with pytest.raises(BadRequestError):
        world.subscribe(print, 0)
