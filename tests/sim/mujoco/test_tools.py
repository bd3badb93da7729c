"""The simulator's tools: start, step, score and film."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from gap_mujoco import tools
from gap_runtime.contracts.failures import BadRequestError, UnknownNameError
from gap_runtime.contracts.types import JointState

pytestmark = pytest.mark.sim


@pytest.fixture
def ctx(world, task):
    return SimpleNamespace(cell=world, task=task, state={}, seed=1)


def test_init_confirms_the_world_that_runs(ctx):
    started = tools.init(ctx, env_name="mujoco", camera_names=["wrist"], task_id="alphabet_soup", suite_name="object")
    assert started.success and started.capabilities["cameras"] == ["agentview", "wrist"]


@pytest.mark.parametrize(
    "wrong", [{"env_name": "gazebo"}, {"task_id": "milk"}, {"camera_names": ["nose"]}, {"config_path": "x.yaml"}]
)
def test_init_says_what_it_cannot_honour(ctx, wrong):
    started = tools.init(ctx, **{"env_name": "mujoco", **wrong})
    assert not started.success and next(iter(wrong)) in started.error_message


def test_reset_begins_the_episode_of_the_seed_and_forgets_the_last(ctx):
    ctx.state["tracker"] = object()
    tools.reset(ctx, seed=4)
    assert ctx.cell.time == 0 and ctx.state == {}
    true = {o.name: o.pose.position.array for o in tools.get_state(ctx).objects}
    for name, pose in ctx.cell.sample(4).poses.items():
        assert np.allclose(true[name], pose.position.array, atol=1e-3)


def test_a_step_is_a_twentieth_of_a_second(ctx):
    stepped = tools.step_once(ctx)
    assert ctx.cell.time == pytest.approx(0.05)
    assert (stepped.reward, stepped.terminated, stepped.truncated) == (0.0, False, False)
    tools.step_once(ctx, gripper_fraction=0.5)
    assert ctx.cell.arms[0].state().gripper.fraction == pytest.approx(0.5, abs=0.02)


def test_joints_are_reached_or_the_request_refused(ctx):
    arm = ctx.cell.arms[0]
    goal = arm.state().joints.positions + 0.1
    assert not tools.move_to_joints(ctx, target_joints=JointState(goal)).truncated
    assert np.allclose(arm.state().joints.positions, goal, atol=0.01)
    with pytest.raises(BadRequestError, match="max_steps 1"):
        tools.move_to_joints(ctx, target_joints=JointState(goal - 0.1), max_steps=1)
    with pytest.raises(BadRequestError, match="7 finite"):
        tools.move_to_joints(ctx, target_joints=JointState(goal[:3]))


def test_jaws_by_fraction(ctx):
    tools.set_gripper(ctx, fraction=0.25)
    assert ctx.cell.arms[0].state().gripper.width == pytest.approx(0.02, abs=0.001)
    with pytest.raises(BadRequestError):
        tools.set_gripper(ctx, fraction=1.5)
    with pytest.raises(UnknownNameError, match="arm '3'"):
        tools.set_gripper(ctx, fraction=0.5, arm_id=3)


def test_a_task_not_begun_is_partly_complete_at_best(ctx):
    score = tools.check_task_completion(ctx)
    assert score == (0.0, False, pytest.approx(2 / 3)), "at rest and let go, but not in the basket"
    with pytest.raises(UnknownNameError, match="apple"):
        tools.check_task_completion(ctx, target="apple")


def test_a_film_has_a_frame_per_twentieth_of_a_second(ctx, tmp_path):
    path = str(tmp_path / "film.mp4")
    assert tools.save_video(ctx, output_path=path, clear=False) == (False, "", 0)
    tools.enable_video_capture(ctx, enabled=True, clear=True)
    ctx.cell.wait(0.5)
    tools.enable_video_capture(ctx, enabled=False, clear=False)
    ctx.cell.wait(0.5)
    film = tools.save_video(ctx, output_path=path, clear=True)
    assert film.success and film.num_frames == 11
    video = cv2.VideoCapture(path)
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 11 and video.read()[1].shape == (480, 640, 3)
    assert not tools.save_video(ctx, output_path=path, clear=False).success


def test_a_film_that_cannot_be_written_says_so(ctx, tmp_path):
    tools.enable_video_capture(ctx, enabled=True, clear=True)
    ctx.cell.wait(0.1)
    tools.enable_video_capture(ctx, enabled=False, clear=False)
    with pytest.raises(BadRequestError, match="Does its folder exist"):
        tools.save_video(ctx, output_path=str(tmp_path / "missing" / "film.mp4"), clear=False)
    with pytest.raises(BadRequestError, match="mp4"):
        tools.save_video(ctx, output_path=str(tmp_path / "film.exe"), clear=False)
