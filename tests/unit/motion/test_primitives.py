"""The scene as VAMP gets it: in the arm's base frame, solid where ours is, and giving way where the arm stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_catalogue.shared.robot_chain import chain, sphere_centers
from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.primitives import Box, PrimitiveScene, box_without, solid_boxes
from gap_motion.collision.world import DistanceField, make_world, with_spheres
from gap_motion.kinematics.robot_model import STATIC, collision_model
from gap_motion.vamp.scene import environment, euler_xyz
from gap_runtime.contracts.types import Obstacle, OrientedBoundingBox, Quaternion, Vec3, WorldConfig
from tests.unit.motion import vamp_like
from tests.unit.motion.conftest import BASE, REGISTRY, random_joints

PANDA = REGISTRY.robot("panda")
POINTS = np.random.default_rng(1).uniform(-0.5, 0.5, (4000, 3))


def obstacle(name, center, half, turn=(1.0, 0.0, 0.0, 0.0)):
    return Obstacle(name, OrientedBoundingBox(Vec3(*center), Vec3(*half), Quaternion(*turn)))


def checker_in(config, base=BASE, margin=0.0):
    arm = chain(PANDA)
    return CollisionChecker(arm, base.matrix, collision_model(arm, PANDA.gripper.max_width), make_world(config), margin)


def moving_spheres(q):
    rows = np.column_stack([sphere_centers(PANDA, q), [s.radius for s in PANDA.spheres]])
    return rows[[chain(PANDA).links[s.link].frame != STATIC for s in PANDA.spheres]]


def inside(boxes, points):
    """Which points (N, 3) are in any of the boxes."""
    found = np.zeros(len(points), dtype=bool)
    for box in boxes:
        found |= (np.abs((points - box.center) @ box.turn.T) <= box.half).all(axis=1)
    return found


def gone(box, left):
    """Where in its own frame (N, 3) a box is no longer."""
    local = np.random.default_rng(2).uniform(-box.half, box.half, (20000, 3))
    return local[~inside(left, local @ box.turn + box.center)]


def test_what_touches_the_scene_touches_vamps_whatever_the_base_and_the_turn_of_a_box():
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_quat()[[3, 0, 1, 2]]
    config = WorldConfig((obstacle("tilted", (-0.2, 0.4, 0.5), (0.2, 0.1, 0.05), turn),))
    checker = checker_in(config)
    checker.world = with_spheres(checker.world, ["ball"], np.array([[-0.5, -0.3, 0.6]]), np.array([0.15]))
    checker.__post_init__()
    world = environment(PrimitiveScene.of(checker), vamp_like, 0.0)
    everything = frozenset(range(len(checker.body.parts)))
    q = random_joints(PANDA, 300)
    ours = [bool(checker.penetrations(row, everything)) for row in q]
    theirs = [world.touches(moving_spheres(row)) for row in q]
    assert 30 < sum(ours) < 270
    assert sum(a != b for a, b in zip(ours, theirs, strict=True)) == 0


@pytest.mark.parametrize("y", [0.3, np.pi / 2, -np.pi / 2, 2.5])
def test_every_turn_has_angles_a_right_one_too(y):
    turns = Rotation.from_euler("ZYX", [[0.4, y, -1.2], [2.0, y, 0.0]])
    again = [vamp_like.Cuboid((0, 0, 0), angles, (1, 1, 1)).axes for angles in euler_xyz(turns.as_matrix())]
    np.testing.assert_allclose([turn.as_matrix() for turn in again], turns.as_matrix(), atol=1e-7)


def test_everything_is_grown_by_the_margin():
    checker = checker_in(WorldConfig((obstacle("box", (0, 0, 1), (0.1, 0.2, 0.3)),)))
    checker.world = with_spheres(checker.world, ["ball"], np.array([[1.0, 0.0, 0.0]]), np.array([0.15]))
    checker.world = replace(checker.world, rounding=np.array([0.01, 0.15]))
    world = environment(PrimitiveScene.of(checker), vamp_like, 0.02)
    np.testing.assert_allclose(world.cuboids[0].half, [0.13, 0.23, 0.33])
    assert world.spheres[0].r == pytest.approx(0.17)


def test_a_field_becomes_boxes_of_its_solid_cells_and_no_others():
    rng = np.random.default_rng(0)
    solid = rng.random((9, 8, 7)) < 0.6
    field = DistanceField(np.array([0.1, -0.2, 0.3]), 0.05, np.where(solid, -0.01, 0.01))
    boxes = list(solid_boxes(field, BASE.matrix))
    assert len(boxes) < solid.sum()
    assert sum(np.prod(2 * box.half) for box in boxes) == pytest.approx(solid.sum() * field.cell**3)
    cells = field.origin + field.cell * np.argwhere(np.ones_like(solid))
    in_base = (cells - BASE.matrix[:3, 3]) @ BASE.matrix[:3, :3]
    np.testing.assert_array_equal(inside(boxes, in_base), solid.ravel())


def test_a_box_gives_way_to_what_is_in_it_and_stays_elsewhere():
    turn = Rotation.from_euler("xyz", [0.3, 0.2, 0.1]).as_matrix()
    box = Box(np.array([0.05, 0.0, 0.0]), turn, np.array([0.3, 0.25, 0.1]))
    spheres = np.array([[0.05, 0.0, 0.12, 0.05], [0.12, 0.0, 0.1, 0.05]])
    left = list(box_without(box, spheres, 0.005, 0.03))
    assert inside(left, POINTS).sum() > 100
    assert not (inside(left, POINTS) & ~inside([box], POINTS)).any()
    for part in left:
        gaps = np.maximum(np.abs((spheres[:, :3] - part.center) @ part.turn.T) - part.half, 0.0)
        assert (np.linalg.norm(gaps, axis=1) > spheres[:, 3] + 0.005).all()
    snug, wide = (gone(box, list(box_without(box, spheres, 0.005, aside))) for aside in (0.0, 0.03))
    assert (wide.min(axis=0)[:2] < snug.min(axis=0)[:2] - 0.01).all()
    assert (wide.max(axis=0)[:2] > snug.max(axis=0)[:2] + 0.01).all()
    far = np.linalg.norm(POINTS - [0.085, 0.0, 0.11], axis=1) > 0.2
    np.testing.assert_array_equal(inside(left, POINTS)[far], inside([box], POINTS)[far])


def test_a_box_that_is_only_near_stays_whole_and_is_grown_less_there():
    box = Box(np.zeros(3), np.eye(3), np.array([0.3, 0.3, 0.1]))
    left = list(box_without(box, np.array([[0.0, 0.0, 0.154, 0.05]]), 0.01, 0.03))
    np.testing.assert_array_equal(inside(left, POINTS), inside([box], POINTS))
    assert sorted(part.most for part in left)[0] == pytest.approx(0.003)
    assert all(part.most == np.inf for part in left if abs(part.center[0]) > 0.1)


def test_nothing_grown_touches_what_it_gave_way_to():
    q = np.array(PANDA.home)
    lowest = (moving_spheres(q)[:, 2] - moving_spheres(q)[:, 3]).min()
    near, deep = (
        obstacle("near", (0, 0, lowest - 0.105), (2, 2, 0.1)),
        obstacle("deep", (-0.6, 0, 0.1), (0.2, 0.2, 0.2)),
    )
    checker = checker_in(WorldConfig((near, deep)))
    checker.world = with_spheres(checker.world, ["ball"], np.array([[-0.3, 0.2, 0.4]]), np.array([0.3]))
    scene = PrimitiveScene.of(checker)
    assert environment(scene, vamp_like, 0.01).touches(moving_spheres(q))
    scene.clear_start_contacts(moving_spheres(q), 0.01)
    world = environment(scene, vamp_like, 0.01)
    assert len(world.cuboids) > 2 and len(world.spheres) == 1 and not world.touches(moving_spheres(q))
