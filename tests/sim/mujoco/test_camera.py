"""Cameras: depth, intrinsics and pose together put every pixel where the thing it shows is."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from gap_mujoco.rendering import gl
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.failures import PrivilegedReadError

pytestmark = pytest.mark.sim


def points(frame):
    """World coordinates of every pixel, shape (H, W, 3)."""
    depth, K = frame.depth.data, frame.intrinsics.data
    rows, cols = np.mgrid[: depth.shape[0], : depth.shape[1]]
    rays = np.stack([(cols - K[0, 2]) / K[0, 0], (rows - K[1, 2]) / K[1, 1], np.ones_like(depth)], axis=-1)
    T = frame.pose.matrix
    return (rays * depth[..., None]) @ T[:3, :3].T + T[:3, 3]


def project(frame, point):
    """Column and row of a world point."""
    T = np.linalg.inv(frame.pose.matrix)
    p = frame.intrinsics.data @ (T[:3, :3] @ point + T[:3, 3])
    return p[:2] / p[2]


def test_the_floor_is_flat_at_zero(world):
    for frame in world.observe().cameras:
        z = points(frame)[..., 2]
        floor = np.abs(z) < 0.004
        assert floor.mean() > 0.4 and np.abs(z[floor]).mean() < 0.0005


@pytest.mark.parametrize("name", ["butter", "cream_cheese", "tomato_sauce"])
def test_depth_at_an_objects_projection_is_its_top(world, name):
    body, (frame,) = world.snapshot().body(name), world.observe(["wrist"]).cameras
    col, row = project(frame, np.array([body.x, body.y, body.top()]))
    found = points(frame)[round(row), round(col)]
    assert np.allclose(found, [body.x, body.y, body.top()], atol=0.002)


def test_frames_are_what_the_camera_was_declared(world, task):
    agent, wrist = world.observe().cameras
    assert (agent.name, wrist.name) == world.camera_names == ("agentview", "wrist")
    width, height = task.cameras["agentview"].resolution
    assert agent.rgb.data.shape == (height, width, 3) and agent.depth.data.shape == (height, width)
    f = agent.intrinsics.data[1, 1]
    assert 2 * np.degrees(np.arctan(height / 2 / f)) == pytest.approx(task.cameras["agentview"].fovy)
    assert np.allclose(agent.pose.position.array, task.cameras["agentview"].position)
    assert agent.stamp == wrist.stamp == world.time


def test_the_wrist_camera_moves_with_the_hand(world, move_to):
    def hand_to_camera():
        T = np.linalg.inv(world.arms[0].state().ee_pose.matrix) @ world.camera_pose("wrist").matrix
        return T, world.observe(["wrist"]).cameras[0].pose.matrix

    before, _ = hand_to_camera()
    move_to(world, [-0.2, 0.1, 0.3])
    after, seen = hand_to_camera()
    assert np.allclose(before, after, atol=1e-6)
    assert np.allclose(seen, world.camera_pose("wrist").matrix)


def test_a_refused_egl_leaves_osmesa_or_one_clear_sentence():
    """In a process of its own: OpenGL is bound once per process."""
    code = (
        "from gap_mujoco.rendering import gl\n"
        "try: print(gl.probe(), gl.make_context(32, 32) is not None)\n"
        "except gl.GraphicsError as error: print(error)"
    )
    environment = {"PATH": "/usr/bin:/bin", "MUJOCO_EGL_DEVICE_ID": "99"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert done.stdout.strip() == "osmesa True" or "apt install" in done.stdout, done.stderr
    assert "Traceback" not in done.stderr


def test_no_opengl_at_all_is_one_sentence_with_what_to_install(monkeypatch):
    def broken(name):
        raise OSError(f"lib{name}.so: cannot open shared object file\nmore")

    monkeypatch.setattr(gl, "_context_class", broken)
    monkeypatch.setattr(gl, "_forget", lambda name: None)
    monkeypatch.delenv("GAP_MUJOCO_GL", raising=False)
    with pytest.raises(gl.GraphicsError) as error:
        gl.probe.__wrapped__()
    assert "libegl.so" in error.value.message and "libosmesa.so" in error.value.message
    assert "apt install" in error.value.hint and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("asked", "words"), [("osmesa", "Unset MUJOCO_GL"), ("nonsense", "'nonsense' names no OpenGL")]
)
def test_a_backend_that_is_not_there_is_one_sentence(asked, words):
    """From the first import of MuJoCo, in a child of a process that has registered the plugin."""
    child = "import mujoco, gap_mujoco\ntry: print(gap_mujoco._rendering())\nexcept Exception as error: print(error)"
    code = f"import gap_mujoco, subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    environment = {**os.environ, "MUJOCO_GL": asked}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert words in done.stdout or (asked, done.stdout.strip()) == ("osmesa", "software OpenGL by osmesa")
    assert done.stderr == ""


def test_true_masks_cover_the_pixels_whose_points_lie_in_the_objects_box(world):
    truth, masks = world.snapshot(), world.true_masks()
    for frame in world.true_frames():
        xyz = points(frame)
        for name, body in truth.bodies.items():
            shown = masks[frame.name][name].data
            R, box = body.box.orientation.rotation.as_matrix(), body.box
            local = np.abs((xyz[shown] - box.center.array) @ R) - box.extent.array
            assert (local < 0.005).all(), name
            inside = (np.abs((xyz - box.center.array) @ R) < box.extent.array - 0.002).all(axis=-1)
            assert name == "basket" or shown[inside].all()
    assert sum(m.data.any() for m in masks["agentview"].values()) == len(truth.bodies)
    with node_scope("policy"), pytest.raises(PrivilegedReadError):
        world.true_masks()
