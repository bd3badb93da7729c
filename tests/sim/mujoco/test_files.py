"""Objects from files: meshes collide as what they are, articulated ones keep their joints, both where they are put."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from gap_mujoco.model.files import convex_parts
from gap_mujoco.model.models import render_objects
from gap_mujoco.simulator import MujocoSimulator
from gap_robots.panda import panda
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.task import load_task

pytestmark = pytest.mark.sim
TASK = """
schema: gap/task/v1
name: kitchen
description: A bowl of its own mesh and a cupboard with a door.
instructions: [Pick the ball and place it in the bowl]
environment:
  supports: {floor: {z: 0.0, half_size: [1.0, 1.0]}}
  workspace: [[-1, -1, 0], [1, 1, 1]]
robots: [{model: panda, position: [-0.6, 0.0, 0.0]}]
cameras: {top: {position: [0.0, 0.0, 1.2], quaternion: [1, 0, 0, 0], fovy: 60, resolution: [160, 120]}}
objects:
  bowl:
    label: bowl
    shape: {kind: mesh, file: bowl.stl, scale: 0.001, cavity: [[0, 0, 0.005], [0.03, 0.03, 0.02]]}
    density: 800
    accepts: ["*"]
  ball: {label: ball, shape: {kind: mesh, file: ball.obj, rotate: [90, 0, 0]}, mass: 0.05}
  cupboard:
    label: cupboard
    shape: {kind: articulated, file: cupboard.xml, size: [0.2, 0.3, 0.3]}
    parts: {shelf: {center: [-0.01, 0, 0.02], size: [0.1, 0.2, 0.02]}}
joints: {door: {range: [0, 1.5], initial: 0.4}}
belief:
  regions:
    here: {center: [0.0, -0.2], support: floor}
    there: {center: [-0.1, 0.1], support: floor, yaw_deg: {constant: 30}}
    back: {center: [-0.15, 0.42], offset: {uniform: [[-0.05, -0.05], [0.05, 0.05]]}, support: floor}
scenes: {all: {bowl: here, ball: there, cupboard: back}}
success: {inside: 'w.body("{target}").is_in(w.body("bowl"))'}
"""
CUPBOARD = """
<mujoco>
  <worldbody>
    <geom name="case" type="box" size="0.09 0.15 0.15" pos="-0.01 0 0" mass="3"/>
    <body name="door" pos="0.09 -0.15 0">
      <joint name="door" axis="0 0 -1" range="0 1.5" damping="0.5"/>
      <geom type="box" size="0.005 0.15 0.15" pos="0.005 0.15 0" mass="0.5"/>
    </body>
  </worldbody>
</mujoco>
"""
URDF = """
<robot name="box"><link name="case"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.3 0.3"/></geometry></collision></link>
<link name="lid"><inertial><mass value="0.2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="door" type="revolute"><parent link="case"/><child link="lid"/><axis xyz="0 0 1"/>
<limit lower="0" upper="1.5" effort="1" velocity="1"/></joint></robot>
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A task of its own meshes: a bowl in millimetres, a textured ball standing on its y axis, a cupboard."""
    folder = tmp_path_factory.mktemp("kitchen")
    (folder / "task.yaml").write_text(TASK)
    (folder / "cupboard.xml").write_text(CUPBOARD)
    profile = np.array([[0, -25], [50, -25], [50, 25], [42, 25], [42, -19], [0, -19]])
    trimesh.creation.revolve(profile, sections=32).export(folder / "bowl.stl")
    ball = trimesh.creation.icosphere(3, 0.03)
    ball.apply_scale([1, 1.2, 1])
    uv = np.column_stack(
        [np.arctan2(ball.vertices[:, 1], ball.vertices[:, 0]) / 7 + 0.5, ball.vertices[:, 2] * 10 + 0.5]
    )
    red = Image.fromarray(np.full((64, 64, 3), (200, 10, 10), np.uint8))
    ball.visual = trimesh.visual.TextureVisuals(uv=uv, image=red)
    ball.export(folder / "ball.obj")
    return folder


@pytest.fixture(scope="module")
def world(folder):
    world = MujocoSimulator(load_task(folder), "all", {"panda": panda()})
    world.reset(world.sample(3))
    yield world
    world.close()


def test_size_and_mass_come_from_the_mesh(folder):
    objects = load_task(folder).objects
    np.testing.assert_allclose(objects["bowl"].shape.size, (0.1, 0.1, 0.05), atol=1e-3)
    np.testing.assert_allclose(objects["ball"].shape.size, (0.06, 0.06, 0.072), atol=1e-3)
    solid = np.pi * (0.05**2 * 0.05 - 0.042**2 * 0.044)
    assert objects["bowl"].mass == pytest.approx(800 * solid, rel=0.02)


def test_a_hollow_mesh_is_hollow_and_its_parts_are_kept(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    shape = load_task(folder).objects["bowl"].shape
    first = convex_parts(shape)
    assert 4 <= len(first) <= shape.parts
    assert not any(_inside(vertices, faces, [0.0, 0.0, 0.01]) for vertices, faces in first)
    (kept,) = tmp_path.rglob("*.npz")
    made = kept.stat().st_mtime_ns
    for (a, b), (c, d) in zip(first, convex_parts(shape), strict=True):
        assert np.array_equal(a, c) and np.array_equal(b, d)
    assert kept.stat().st_mtime_ns == made


def _inside(vertices, faces, point):
    return bool(trimesh.Trimesh(vertices, faces).convex_hull.contains([point])[0])


def test_what_is_let_go_over_the_bowl_comes_to_rest_inside(world):
    instance = world.sample(3)
    bowl, ball = instance.poses["bowl"], instance.poses["ball"]
    above = type(ball)(type(ball.position)(bowl.position.x, bowl.position.y, 0.046), ball.rotation)
    world.reset(type(instance)(3, "all", {**instance.poses, "ball": above}, instance.joints))
    now = world.snapshot()
    assert now.body("ball").is_in(now.body("bowl")) and now.body("ball").touches("bowl")
    assert now.body("bowl").is_settled()
    world.reset(instance)


def test_a_fixed_object_stands_where_the_instance_puts_it_and_keeps_its_joint(world):
    for seed in (4, 5):
        instance = world.sample(seed)
        world.reset(instance)
        now = world.snapshot()
        np.testing.assert_allclose(
            now.bodies["cupboard"].pose.position.array, instance.poses["cupboard"].position.array, atol=1e-9
        )
        assert now.joint("door") == pytest.approx(0.4, abs=0.02)
        shelf = now.bodies["cupboard"].parts["shelf"]
        np.testing.assert_allclose(shelf.extent.array, [0.05, 0.1, 0.01])
        assert shelf.center.z == pytest.approx(0.17)


def test_a_texture_is_seen(world):
    world.reset(world.sample(6))
    frame, masks = world.observe(["top"]).cameras[0], world.true_masks()["top"]
    red, green, blue = frame.rgb.data[masks["ball"].data].mean(axis=0)
    assert red > 2 * green and red > 2 * blue


def test_urdf_is_read_like_mjcf(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "urdf")
    (tmp_path / "urdf" / "box.urdf").write_text(URDF)
    task = tmp_path / "urdf" / "task.yaml"
    task.write_text(TASK.replace("file: cupboard.xml", "file: box.urdf"))
    world = MujocoSimulator(load_task(tmp_path / "urdf"), "all", {"panda": panda()})
    try:
        world.reset(world.sample(3))
        assert world.snapshot().joint("door") == pytest.approx(0.4, abs=0.02)
    finally:
        world.close()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("file: bowl.stl", "file: bow.stl"), "bow.stl' is not there"),
        (("file: bowl.stl", "file: task.yaml"), "cannot be read as a mesh"),
        (("density: 800", "density: 800\n    mass: 1"), "bowl.mass: should not stand beside density"),
        (("file: cupboard.xml, ", ""), "shape.file: is missing, and needed for kind articulated"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_when_the_task_is_read(folder, tmp_path, change, says):
    shutil.copytree(folder, tmp_path / "bad")
    (tmp_path / "bad" / "task.yaml").write_text(TASK.replace(*change))
    with pytest.raises(DocumentError, match=says):
        load_task(tmp_path / "bad")


def test_a_model_of_another_size_is_refused(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "size")
    (tmp_path / "size" / "task.yaml").write_text(TASK.replace("[0.2, 0.3, 0.3]", "[0.2, 0.3, 0.2]"))
    with pytest.raises(DocumentError, match=r"is not that of the model in cupboard.xml: \[0.2, 0.3, 0.3\]"):
        MujocoSimulator(load_task(Path(tmp_path / "size")), "all", {"panda": panda()})


def test_they_are_rendered_alone_like_any_other_model(folder):
    views = render_objects(load_task(folder).objects, yaws_deg=(0,), elevations_deg=(40,))
    assert [v.name for v in views] == ["bowl", "ball", "cupboard"]
    assert all(v.mask.data.any() and not v.mask.data[0].any() for v in views)
