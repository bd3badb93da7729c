"""What a recording shows of an object is as large, as hollow and as handled as its shape says."""

from __future__ import annotations

import numpy as np
import pytest
from foxglove import messages as fg
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from gap_cli.rehearse.recording.foxglove_scene import entity
from gap_runtime.contracts.task import ObjectModel, Shape

SHAPES = {
    "box": Shape(kind="box", size=(0.1, 0.2, 0.05)),
    "cylinder": Shape(kind="cylinder", size=(0.06, 0.06, 0.1)),
    "open_box": Shape(kind="open_box", size=(0.2, 0.3, 0.1), wall=0.02, floor=0.01),
    "pan": Shape(kind="pan", size=(0.35, 0.20, 0.05), wall=0.005, floor=0.005, handle=(0.03, 0.01)),
    "mug": Shape(kind="mug", size=(0.12, 0.085, 0.095), wall=0.004, floor=0.006, handle=(0.014, 0.008)),
}


def drawn(kind):
    """The entity as a reader of the recording decodes it."""
    model = ObjectModel(label=kind, shape=SHAPES[kind], mass=0.1, looks={"base": "#ff0000"})
    made = fg.SceneUpdate(entities=[entity(kind, model, fg.Timestamp(sec=0, nsec=0))])
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(fg.SceneUpdate.get_schema().data).file:
        pool.Add(file)
    read = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.SceneUpdate"))
    return read.FromString(made.encode()).entities[0]


def corners(scene):
    """Every outermost point of what is drawn, shape (N, 3)."""
    found = []
    for solid in (*scene.cubes, *scene.cylinders):
        centre, size = solid.pose.position, solid.size
        signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), -1).reshape(-1, 3)
        found.append(signs * [size.x, size.y, size.z] + [centre.x, centre.y, centre.z])
    for mesh in scene.triangles:
        at = mesh.pose.position
        found.append(np.array([[p.x + at.x, p.y + at.y, p.z + at.z] for p in mesh.points]))
    return np.concatenate(found)


@pytest.mark.parametrize("kind", SHAPES)
def test_it_fills_its_size(kind):
    points, half = corners(drawn(kind)), np.array(SHAPES[kind].size) / 2
    np.testing.assert_allclose(points.max(axis=0), half, atol=1e-9)
    np.testing.assert_allclose(points.min(axis=0), -half, atol=1e-9)


@pytest.mark.parametrize("kind", ["pan", "mug"])
def test_a_round_wall_is_a_closed_tube_of_its_thickness(kind):
    (mesh,) = drawn(kind).triangles
    points = np.array([[p.x, p.y, p.z] for p in mesh.points])
    radius, wall = SHAPES[kind].size[1] / 2, SHAPES[kind].wall
    assert set(np.round(np.hypot(points[:, 0], points[:, 1]), 9)) == {round(radius, 9), round(radius - wall, 9)}
    faces = np.array(mesh.indices).reshape(-1, 3)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward, back = {tuple(e) for e in edges}, {(b, a) for a, b in edges}
    assert len(forward) == len(edges) and forward == back  # every edge is shared by two triangles, turned alike
    a, b, c = points[faces].transpose(1, 0, 2)
    volume = (np.einsum("ij,ij->i", a, np.cross(b, c)) / 6).sum()
    assert volume == pytest.approx(np.pi * (radius**2 - (radius - wall) ** 2) * SHAPES[kind].size[2], rel=0.01)


def test_a_pan_is_held_by_one_bar_and_a_mug_by_an_ear():
    assert len(drawn("pan").cubes) == 1 and len(drawn("mug").cubes) == 3
    assert not drawn("cylinder").triangles and drawn("cylinder").cylinders[0].color.r == 1
