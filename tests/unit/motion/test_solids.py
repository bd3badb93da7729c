"""Cylinders and meshes among the obstacles: as far away as geometry says, and refused when they are none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.world import VOXEL, make_world, with_spheres
from gap_motion.kinematics.robot_model import collision_model
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Obstacle, OrientedBoundingBox, Quaternion, Vec3, WorldConfig
from tests.unit.motion.conftest import random_joints

LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)
TURNED = Quaternion.of(Rotation.from_euler("xyz", [30, -50, 70], degrees=True))
CENTER, RADIUS, HALF = np.array([0.4, -0.1, 0.3]), 0.08, 0.15
RNG = np.random.default_rng(0)
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def bounds(half, rotation=LEVEL):
    return OrientedBoundingBox(Vec3.of(CENTER), Vec3.of(np.asarray(half, dtype=float)), rotation)


def can(rotation=LEVEL):
    return Obstacle("can", bounds((RADIUS, RADIUS, HALF), rotation), cylinder=True)


def mesh(half, triangles=FACES, rotation=LEVEL):
    turn = rotation.rotation.as_matrix()
    return Obstacle("mesh", bounds(half, rotation), CENTER + CORNERS * half @ turn.T, triangles)


def world_of(*obstacles):
    return make_world(WorldConfig(obstacles))


@pytest.mark.parametrize("rotation", [LEVEL, TURNED])
def test_a_cylinder_is_as_far_as_geometry_says(rotation):
    points = CENTER + RNG.uniform(-0.3, 0.3, (2000, 3))
    local = (points - CENTER) @ rotation.rotation.as_matrix()
    beyond = np.stack([np.hypot(local[:, 0], local[:, 1]) - RADIUS, np.abs(local[:, 2]) - HALF])
    truth = np.linalg.norm(np.maximum(beyond, 0), axis=0) + np.minimum(beyond.max(axis=0), 0)
    found = world_of(can(rotation)).box_distance(points[None].astype(np.float32), np.array([0]))[0]
    np.testing.assert_allclose(found, truth, atol=1e-5)


def test_boxes_and_spheres_beside_a_cylinder_stay_what_they_are():
    alone = world_of(Obstacle("box", bounds((0.1, 0.05, 0.02), TURNED)))
    with_can = world_of(Obstacle("box", bounds((0.1, 0.05, 0.02), TURNED)), can())
    points = (CENTER + RNG.uniform(-0.3, 0.3, (1, 100, 3))).astype(np.float32)
    box = np.array([0])
    np.testing.assert_array_equal(alone.box_distance(points, box), with_can.box_distance(points, box))
    more = with_spheres(with_can, ["ball"], CENTER[None], np.array([0.05]))
    ball = more.box_distance(points, np.array([2]))[0]
    np.testing.assert_allclose(ball, np.linalg.norm(points[0] - CENTER, axis=1) - 0.05, atol=1e-6)


def test_beside_a_cylinder_is_room_that_its_box_takes(spec, arm):
    body, q = collision_model(arm, spec.gripper.max_width), random_joints(spec, 300)
    box = Obstacle("box", bounds((0.25, 0.25, HALF)))
    round_one = Obstacle("can", bounds((0.25, 0.25, HALF)), cylinder=True)
    in_box, in_can = (CollisionChecker(arm, np.eye(4), body, world_of(o)).valid(q) for o in (box, round_one))
    assert not (in_box & ~in_can).any() and (in_can & ~in_box).any()


@pytest.mark.parametrize("rotation", [LEVEL, TURNED])
def test_a_closed_mesh_is_solid_and_no_farther_than_it_is(rotation):
    half = (0.12, 0.08, 0.1)
    (field,) = world_of(mesh(half, rotation=rotation)).fields.values()
    points = CENTER + RNG.uniform(-0.2, 0.2, (3000, 3))
    local = np.abs((points - CENTER) @ rotation.rotation.as_matrix()) - half
    truth = np.linalg.norm(np.maximum(local, 0), axis=1) + np.minimum(local.max(axis=1), 0)
    found = field.distance(points)
    near = truth < 0.1
    assert (found <= truth + VOXEL / 2)[near].all(), "never farther away than it is"
    assert (found >= truth - 2.2 * VOXEL)[near].all(), "nor much nearer"


def test_an_open_mesh_is_a_shell():
    (field,) = world_of(mesh((0.12, 0.12, 0.1), FACES[:10][[0, 1, 2, 3, 4, 5, 6, 7]])).fields.values()
    assert field.distance(CENTER[None])[0] > 0.05
    assert field.distance((CENTER - [0.12, 0, 0])[None])[0] < VOXEL


@pytest.mark.parametrize(
    ("obstacle", "code", "said"),
    [
        (Obstacle("o", bounds((0.1, 0.2, 0.1)), cylinder=True), "range", "radius 0.1 and 0.2"),
        (Obstacle("o", bounds((0.1, 0.1, 0.1)), np.zeros((3, 3)), cylinder=True), "shape", "points as well"),
        (Obstacle("o", bounds((0.1, 0.1, 0.1)), None, FACES), "shape", "without vertices"),
        (Obstacle("o", bounds((0.1, 0.1, 0.1)), CENTER + CORNERS * 0.1, np.zeros((0, 3), int)), "shape", "triangles"),
        (Obstacle("o", bounds((0.1, 0.1, 0.1)), CENTER + CORNERS * 0.1, FACES + 1), "range", "vertex 8, of 8"),
        (Obstacle("o", bounds((0.1, 0.1, 0.1)), CENTER + CORNERS * 0.1, FACES - 1), "range", "vertex -1"),
        (Obstacle("o", bounds((0.1, 0.1, 0.05)), CENTER + CORNERS * 0.1, FACES), "range", "leaves its box by 0.050"),
        (mesh((90, 0.001, 0.001)), "too_large", "samples"),
        (Obstacle("o", bounds((1, 1, 1)), CENTER + CORNERS * np.nan, FACES), "not_finite", "not finite"),
    ],
)
def test_what_is_no_solid_is_refused(obstacle, code, said):
    with pytest.raises(BadRequestError, match=said) as caught:
        world_of(obstacle)
    assert caught.value.code == code
