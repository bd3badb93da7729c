"""Noisy cameras: alike for alike seeds, constant where they must be, and untouched where nothing is declared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gap_mujoco.rendering.noise import calibration_error
from gap_mujoco.simulator import MujocoSimulator
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.failures import DocumentError, PrivilegedReadError
from gap_runtime.contracts.task.sensors import CameraNoise, Sensors, StereoDepth

pytestmark = pytest.mark.sim

DEPTH = StereoDepth(baseline=0.055, focal=1005, subpixel=0.08, grain=1, jitter=0.8, dropout=0.01, unit=0.001)
NOISE = CameraNoise(depth=DEPTH, colour=5, light=0.2, shift=0.002, turn=0.2)


def with_noise(task, use="real", **models):
    return task.model_copy(update={"sensors": Sensors(models={"real": NOISE, **models}, use=use)})


@pytest.fixture(scope="module")
def noisy(task, robots):
    world = MujocoSimulator(with_noise(task), "alphabet_soup", robots)
    world.reset(world.sample(1))
    yield world
    world.close()


@pytest.fixture
def instance(noisy):
    """An episode of its own begins."""
    drawn = noisy.sample(1)
    noisy.reset(drawn)
    return drawn


def frames(world, *names):
    return {c.name: c for c in world.observe(names or None).cameras}


def same(a, b):
    return a.rgb == b.rgb and a.depth == b.depth and a.pose == b.pose


def error(world, name):
    """T_calibrated_true, from what the robot is told and where the camera is."""
    true = next(f for f in world.true_frames() if f.name == name).pose.matrix
    return np.linalg.inv(world.camera_pose(name).matrix) @ true


def test_without_noise_frames_are_the_renderers_own(world, task):
    assert not task.sensors.use
    model = world._scene.model
    lights, cameras = model.light_diffuse.copy(), model.cam_pos.copy()
    world.reset(world.sample(3))
    for seen, true in zip(world.observe().cameras, world.true_frames(), strict=True):
        assert same(seen, true) and seen.pose == world.camera_pose(seen.name)
    assert (model.light_diffuse == lights).all() and (model.cam_pos == cameras).all()


def test_models_of_zeros_change_no_byte(task, robots, world):
    blank = MujocoSimulator(with_noise(task, "none", none=CameraNoise()), "alphabet_soup", robots)
    blank.reset(blank.sample(1))
    for a, b in zip(blank.observe().cameras, world.observe().cameras, strict=True):
        assert a.rgb == b.rgb and a.depth == b.depth and np.allclose(a.pose.matrix, b.pose.matrix, atol=1e-12)
    blank.close()


def test_the_same_episode_looks_the_same(noisy, instance):
    first = frames(noisy)
    noisy.wait(0.02)
    noisy.reset(instance)
    assert all(same(first[n], f) for n, f in frames(noisy).items())
    noisy.reset(replace(instance, seed=2))
    assert not any(same(first[n], f) for n, f in frames(noisy).items())


def test_who_else_looks_changes_nothing(noisy, instance):
    wrist = frames(noisy, "wrist")["wrist"]
    assert same(wrist, frames(noisy)["wrist"])
    unsubscribe = noisy.subscribe(lambda frame: None, 100, noisy.camera_names)
    noisy.wait(0.05)
    unsubscribe()
    later = frames(noisy, "wrist")["wrist"]
    noisy.reset(instance)
    noisy.wait(0.05)
    assert same(later, frames(noisy, "wrist")["wrist"]) and not same(later, wrist)


def test_noise_is_new_in_every_frame(noisy, instance):
    before = frames(noisy, "agentview")["agentview"]
    noisy.wait(0.002)
    after = frames(noisy, "agentview")["agentview"]
    changed = after.rgb.data.astype(float) - before.rgb.data
    assert changed.std() == pytest.approx(5 * np.sqrt(2), rel=0.1)


def test_calibration_is_wrong_by_the_same_all_through_an_episode(noisy, instance, move_to):
    before = {name: error(noisy, name) for name in noisy.camera_names}
    for E in before.values():
        assert 0 < np.linalg.norm(E[:3, 3]) < 4 * NOISE.shift
        assert 0 < np.degrees(np.arccos((np.trace(E[:3, :3]) - 1) / 2)) < 4 * NOISE.turn
    assert not np.allclose(before["agentview"], before["wrist"])
    move_to(noisy, [-0.2, 0.1, 0.3])
    assert all(np.allclose(error(noisy, name), E, atol=1e-9) for name, E in before.items())
    noisy.reset(replace(instance, seed=7))
    assert not any(np.allclose(error(noisy, name), E, atol=1e-5) for name, E in before.items())


def test_the_robot_is_told_what_was_declared_not_where_the_camera_is(noisy, instance, task):
    seen = frames(noisy)
    assert np.allclose(seen["agentview"].pose.position.array, task.cameras["agentview"].position)
    for name, frame in seen.items():
        assert frame.pose == noisy.camera_pose(name)
    with node_scope("policy"), pytest.raises(PrivilegedReadError):
        noisy.true_frames()


def test_the_calibration_error_is_as_large_as_declared():
    drawn = [calibration_error(NOISE, np.random.default_rng(i)) for i in range(2000)]
    lengths = [np.sum(E[:3, 3] ** 2) for E in drawn]
    angles = [np.degrees(np.arccos(np.clip((np.trace(E[:3, :3]) - 1) / 2, -1, 1))) ** 2 for E in drawn]
    assert np.sqrt(np.mean(lengths)) == pytest.approx(NOISE.shift, rel=0.05)
    assert np.sqrt(np.mean(angles)) == pytest.approx(NOISE.turn, rel=0.05)


def test_a_displaced_camera_still_sees_the_floor_where_it_is(noisy, instance):
    from tests.sim.mujoco.test_camera import points

    for frame in noisy.true_frames():
        z = points(frame)[..., 2]
        floor = np.abs(z) < 0.004
        assert floor.mean() > 0.4 and np.abs(z[floor]).mean() < 0.0005


def test_the_light_changes_with_the_episode_and_stays_within_it(noisy, instance, world):
    model, declared = noisy._scene.model, world._scene.model.light_diffuse

    def brightness():
        return np.array([f.rgb.data.mean() for f in noisy.true_frames()])

    first, lamps = brightness(), model.light_diffuse.copy()
    noisy.wait(0.02)
    assert (model.light_diffuse == lamps).all()
    seen = []
    for seed in range(6, 11):
        noisy.reset(replace(instance, seed=seed))
        ratio = model.light_diffuse / declared
        assert (ratio >= (1 - NOISE.light) ** 2 - 1e-6).all() and (ratio <= (1 + NOISE.light) ** 2 + 1e-6).all()
        seen.append(brightness())
    assert np.ptp(seen, axis=0).min() > 3 and not np.allclose(seen[0], first)


def test_one_camera_alone_may_be_noisy(task, robots, world):
    world.reset(world.sample(1))
    mixed = MujocoSimulator(with_noise(task, {"wrist": "dark"}, dark=CameraNoise(colour=9)), "alphabet_soup", robots)
    mixed.reset(mixed.sample(1))
    clean, seen = frames(world), frames(mixed)
    assert same(clean["agentview"], seen["agentview"])
    assert clean["wrist"].depth == seen["wrist"].depth and clean["wrist"].rgb != seen["wrist"].rgb
    mixed.close()


def test_a_camera_the_cell_does_not_have_is_named(task, robots):
    with pytest.raises(DocumentError, match=r"task.yaml: sensors.use.wirst: is not a camera Did you mean 'wrist'"):
        MujocoSimulator(with_noise(task, {"wirst": "real"}), "alphabet_soup", robots)
