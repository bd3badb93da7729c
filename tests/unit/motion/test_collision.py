from itertools import pairwise

import numpy as np
import pytest

from gap_motion.bench.problems import FLOOR, checker_among, world_of
from gap_motion.bench.verify import ObstacleShape, TrajectoryVerifier
from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.world import graspable, make_world, with_spheres
from gap_motion.kinematics.robot_model import collision_model, with_attached
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planning_scene import cover_held
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Obstacle, OrientedBoundingBox, Quaternion, Vec3, WorldConfig
from tests.unit.motion.conftest import random_joints

LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)
TILTED = Quaternion(0.9238795325112867, 0.2209424, 0.2209424, 0.2209424)


def box(name, center, half, points=None, rotation=LEVEL):
    return Obstacle(name, OrientedBoundingBox(Vec3(*center), Vec3(*half), rotation), points)


def shapes(seed):
    rng = np.random.default_rng(seed)
    return (
        FLOOR,
        *(ObstacleShape(tuple(rng.uniform(-0.8, 0.8, 3)), tuple(rng.uniform(0.03, 0.15, 3))) for _ in range(6)),
    )


@pytest.mark.parametrize("seed", range(3))
def test_what_is_free_here_is_free_in_mujoco(spec, seed):
    """The spheres contain the collision shapes, so this checker may err on the safe side only."""
    around = shapes(seed)
    q = random_joints(spec, 150, seed, margin=0.0)
    free = checker_among(spec, around).valid(q)
    judge = TrajectoryVerifier(spec, around)
    truly = np.array([judge.free(row) for row in q])
    assert 0.05 < free.mean() < 0.95
    assert not (free & ~truly).any()
    assert (truly & ~free).mean() < 0.1, "too careful: free space is lost"


def test_all_answers_agree(spec):
    checker = checker_among(spec, shapes(1))
    q = random_joints(spec, 40)
    valid = checker.valid(q)
    assert [checker.free(row[None]) for row in q] == list(valid)
    contact = checker.first_contact(q)
    assert contact is not None and contact.index == int(np.argmin(valid)) and contact.depth > 0
    assert checker.first_contact(q[valid]) is None


def test_a_contact_names_the_link_and_the_obstacle(spec, arm):
    home = np.array(spec.home)
    p = arm.tcp_poses(home)[0, :3, 3]
    scene = make_world(WorldConfig((box("mug", p, (0.03, 0.06, 0.03)), box("far", p + 2.0, (0.1, 0.1, 0.1)))))
    contact = CollisionChecker(arm, np.eye(4), collision_model(arm, spec.gripper.max_width), scene).first_contact(home)
    assert contact is not None and contact.other == "mug" and contact.link in arm.links


def test_what_is_allowed_may_be_touched_and_no_more(spec, arm):
    home, body = np.array(spec.home), collision_model(arm, spec.gripper.max_width)
    p = arm.tcp_poses(home)[0, :3, 3]
    scene = make_world(WorldConfig((box("mug", p, (0.02, 0.04, 0.02)),)))
    allowed = {(part, 0): np.inf for part in body.grippers}
    assert CollisionChecker(arm, np.eye(4), body, scene, allowed=allowed).free(home)
    assert not CollisionChecker(arm, np.eye(4), body, scene).free(home)


def test_margins_grow_what_counts_as_contact(spec, arm):
    home, body = np.array(spec.home), collision_model(arm, spec.gripper.max_width)
    p = arm.tcp_poses(home)[0, :3, 3]
    scene = make_world(WorldConfig((box("plate", p - [0, 0, 0.06], (0.1, 0.1, 0.01)),)))
    assert CollisionChecker(arm, np.eye(4), body, scene, margin=0.0).free(home)
    assert not CollisionChecker(arm, np.eye(4), body, scene, margin=0.08).free(home)


def test_the_base_pose_moves_robot_and_spheres(spec, arm, cell):
    base, q = cell.arm.base_pose.matrix, random_joints(spec, 60)
    scene = make_world(WorldConfig((box("block", (0.4, 0.0, 0.3), (0.2, 0.2, 0.2)),)))
    moved = np.linalg.inv(base) @ np.array([0.4, 0.0, 0.3, 1.0])
    turned = Quaternion.of(cell.arm.base_pose.rotation.rotation.inv())
    same = make_world(WorldConfig((box("block", moved[:3], (0.2, 0.2, 0.2), rotation=turned),)))
    body = collision_model(arm, 0.0)
    in_world, in_base = CollisionChecker(arm, base, body, scene), CollisionChecker(arm, np.eye(4), body, same)
    assert (in_world.valid(q) == in_base.valid(q)).mean() > 0.98


def basket_points():
    t = np.arange(-0.1, 0.1001, 0.005)
    z = np.arange(0.0, 0.1501, 0.005)
    floor = [(x, y, 0.0) for x in t for y in t]
    walls = [(s * 0.1, y, h) for s in (-1, 1) for y in t for h in z] + [
        (x, s * 0.1, h) for s in (-1, 1) for x in t for h in z
    ]
    return np.array(floor + walls)


def test_a_basket_seen_from_above_stays_open_and_a_can_is_solid():
    basket = box("basket", (0, 0, 0.075), (0.1, 0.1, 0.075), basket_points())
    field = make_world(WorldConfig((basket,))).fields[0]
    inside, wall, above = np.array([[0.0, 0.0, 0.08]]), np.array([[0.1, 0.0, 0.08]]), np.array([[0.0, 0.0, 0.25]])
    assert field.distance(inside)[0] > 0.05 and field.distance(above)[0] > 0.05
    assert field.distance(wall)[0] <= 0.005
    top = np.array([(x, y, 0.1) for x in np.arange(-0.03, 0.031, 0.005) for y in np.arange(-0.03, 0.031, 0.005)])
    can = box("can", (0, 0, 0.05), (0.1, 0.03, 0.05), top)
    solid = make_world(WorldConfig((can,))).fields[0]
    assert solid.distance(np.array([[0.0, 0.0, 0.04]]))[0] < -0.02


def test_points_that_fill_their_box_are_that_box():
    grid = np.stack(np.meshgrid(*[np.arange(-0.03, 0.031, 0.005)] * 3, indexing="ij"), -1).reshape(-1, 3)
    assert not make_world(WorldConfig((box("brick", (0, 0, 0), (0.03, 0.03, 0.03), grid),))).fields


def test_distances_of_tilted_boxes_and_spheres_are_geometry():
    scene = make_world(WorldConfig((box("b", (0.1, 0.2, 0.3), (0.05, 0.1, 0.2), rotation=TILTED),)))
    R = TILTED.rotation.as_matrix()
    points = np.array([[0.1, 0.2, 0.3] + R @ v for v in ([0.15, 0, 0], [0, 0.13, 0], [0.08, 0.14, 0.2], [0, 0, 0.15])])
    expected = [0.1, 0.03, 0.05, -0.05]
    np.testing.assert_allclose(scene.box_distance(points[None], np.array([0]))[0], expected, atol=1e-6)
    ball = with_spheres(make_world(None), ["ball"], np.array([[1.0, 0, 0]]), np.array([0.2]))
    np.testing.assert_allclose(ball.box_distance(np.zeros((1, 1, 3)), np.array([0]))[0], [0.8], atol=1e-6)


def test_an_edge_is_free_when_all_on_it_is_but_for_a_graze(spec):
    checker = checker_among(spec, shapes(2))
    q = random_joints(spec, 60)
    q = q[checker.valid(q)]
    edges = MotionValidator(checker)
    answers = [(edges.free(a, b), checker.free(a + np.linspace(0, 1, 400)[:, None] * (b - a))) for a, b in pairwise(q)]
    assert np.mean([ours == dense for ours, dense in answers]) > 0.95, "only a graze between samples may be missed"
    assert {ours for ours, _ in answers} == {True, False}


def test_a_held_object_is_part_of_the_robot(spec, arm):
    home, body = np.array(spec.home), collision_model(arm, 0.04)
    frame = arm.poses(home, np.eye(4))[0]
    at_tcp = np.linalg.inv(frame) @ arm.tcp_poses(home)[0]
    half = np.array([0.02, 0.02, 0.15])
    held = with_attached(body, "bottle", cover_held(half, at_tcp), arm.dof - 1)
    p = arm.tcp_poses(home)[0, :3, 3]
    scene = make_world(WorldConfig((box("table", p - [0, 0, 0.13], (0.3, 0.3, 0.01)),)))
    assert CollisionChecker(arm, np.eye(4), body, scene).free(home)
    contact = CollisionChecker(arm, np.eye(4), held, scene).first_contact(home)
    assert contact is not None and (contact.link, contact.other) == ("bottle", "table")
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * half
    spheres = cover_held(half, np.eye(4))
    gaps = [np.linalg.norm(corners - s.center, axis=1) - s.radius for s in spheres]
    assert np.min(gaps, axis=0).max() <= 1e-9


def test_bad_obstacles_are_named():
    nan = box("ghost", (np.nan, 0, 0), (1, 1, 1))
    with pytest.raises(BadRequestError, match="ghost") as error:
        make_world(WorldConfig((nan,)))
    assert error.value.code == "not_finite"
    with pytest.raises(BadRequestError) as error:
        make_world(WorldConfig((box("a", (0, 0, 0), (1, 1, 1)),)), ["b"])
    assert error.value.code == "unknown_obstacle"


def test_a_million_points_become_one_solid_field():
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (1_000_000, 3))
    scene = make_world(WorldConfig((box("cloud", (0, 0, 0), (0.6, 0.6, 0.6), points),)))
    (field,) = scene.fields.values()
    assert field.distance(np.zeros((1, 3)))[0] < 0


def test_what_is_between_the_jaws_is_grasped_and_a_table_is_not():
    config = WorldConfig((box("bar", (0, 0, 0), (0.2, 0.02, 0.02)), box("table", (0, 0, -0.02), (1, 1, 0.02))))
    across, along = np.eye(4), np.eye(4)
    along[:3, :3] = Quaternion(0.7071068, 0, 0, 0.7071068).rotation.as_matrix()
    assert graspable(config, across[None], 0.08) == ["bar"]
    assert graspable(config, along[None], 0.08) == []
    assert graspable(None, across[None], 0.08) == []


def test_scene_of_shapes_keeps_their_order(spec):
    assert world_of(shapes(0)).names[0] == "shape_0"
