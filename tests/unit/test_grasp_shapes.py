"""Hollow and handled things: closed as height maps, taken by rim and handle; and cameras that see only a top."""

from __future__ import annotations

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from gap_catalogue.shared.hand import Hand, above, clear_of
from gap_grasps import tools
from gap_grasps.support import plane_around
from gap_grasps.surface import closed_surface, thinned
from gap_robots.panda import panda
from gap_runtime.contracts.robot import CollisionSphere
from gap_runtime.contracts.types import DepthImage, Mask, Matrix3x3, PointCloud, Quaternion, Se3Pose, Vec3

PANDA = panda()
HAND = Hand.of(PANDA)
DOWN = Quaternion(0.0, 1.0, 0.0, 0.0)
STEP = 0.0025


def context():
    support = SimpleNamespace(z=0.0, center=(0.0, 0.0), half_size=(1.0, 1.0))
    task = SimpleNamespace(environment=SimpleNamespace(supports={"floor": support}))
    return SimpleNamespace(seed=0, task=task, robot=lambda arm_id=0: PANDA)


def ring(radius, wall, top):
    """What is seen of a cup from above: the rim's top alone."""
    angle = np.arange(0, 2 * np.pi, STEP / radius)
    r = np.arange(radius - wall, radius + 1e-9, wall / 4)
    a, r = (g.ravel() for g in np.meshgrid(angle, r))
    return np.column_stack([r * np.cos(a), r * np.sin(a), np.full(len(a), top)])


def slab(x, y, top):
    """The top of a flat thing, seen from above."""
    gx, gy = (g.ravel() for g in np.meshgrid(np.arange(*x, STEP), np.arange(*y, STEP)))
    return np.column_stack([gx, gy, np.full(len(gx), top)])


def pose(x=0.0, y=0.0, z=0.0, rotation=DOWN):
    return Se3Pose(Vec3(x, y, z), rotation).matrix


def test_hidden_sides_are_upright_walls_facing_out():
    closed = closed_surface(slab((-0.03, 0.03), (-0.02, 0.02), 0.05), 0.0)
    walls, normals = closed.points[closed.guessed], closed.normals[closed.guessed]
    assert walls[:, 2].min() < 0.005 and walls[:, 2].max() < 0.05
    middle = np.abs(walls[:, 1]) < 0.01
    assert (normals[middle, 0] * np.sign(walls[middle, 0]) > 0.99).all()
    np.testing.assert_allclose(np.abs(walls[middle, 0]), 0.03, atol=0.003)


def test_a_turned_box_has_straight_walls():
    yaw = np.radians(30)
    R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    closed = closed_surface(slab((-0.05, 0.05), (-0.03, 0.03), 0.05) @ R.T, 0.0)
    local, normals = closed.points[closed.guessed] @ R, closed.normals[closed.guessed] @ R
    side = (np.abs(local[:, 0]) < 0.03) & (local[:, 1] > 0)
    assert np.median(normals[side, 1]) > 0.98
    assert np.median(np.abs(local[side, 1] - 0.03)) < 0.0015


def test_a_cup_is_hollow_and_taken_by_its_rim():
    points = ring(0.045, 0.004, 0.09)
    closed = closed_surface(points, 0.0)
    walls = closed.guessed
    outward = np.einsum("ni,ni->n", closed.normals[walls, :2], closed.points[walls, :2]) > 0
    assert 0.3 < outward.mean() < 0.8, "walls on the outside and on the inside"
    found = tools.plan_from_point_cloud(context(), target_cloud=PointCloud(points))
    assert found.grasp_poses
    for p in found.grasp_poses[:5]:
        assert abs(np.hypot(p.position.x, p.position.y) - 0.043) < 0.01, "too wide for the jaws but at the rim"


def test_a_handle_is_taken_across():
    points = np.concatenate([slab((-0.1, 0.1), (-0.1, 0.1), 0.03), slab((0.1, 0.22), (-0.0125, 0.0125), 0.05)])
    found = tools.plan_from_point_cloud(context(), target_cloud=PointCloud(points))
    assert found.grasp_poses
    for p in found.grasp_poses[:5]:
        assert p.position.x > 0.1 and abs(p.matrix[1, 1]) > 0.9


def test_the_hand_is_the_flange_links_spheres_seen_from_the_tcp():
    spheres = (
        CollisionSphere("panda_hand", (0.0, 0.0, 0.05), 0.03),
        CollisionSphere("panda_leftfinger", (0, 0, 0), 1.0),
    )
    hand = Hand.of(SimpleNamespace(**{**vars(PANDA), "spheres": spheres}))
    np.testing.assert_allclose(hand.centers, [[0, 0, 0.05 - PANDA.tcp_offset_position[2]]], atol=1e-9)


def test_a_hand_meets_what_is_in_its_way():
    T = pose(z=0.1)[None]
    finger = PANDA.gripper.max_width / 2 + PANDA.gripper.finger_size[0]
    beside, between, palm = np.array([[[0, finger, 0.1]], [[0, 0.02, 0.1]], [[0, 0, 0.16]]]).repeat(5, axis=1)
    assert clear_of(between, T, HAND).all() and clear_of(np.zeros((0, 3)), T, HAND).all()
    assert not clear_of(beside, T, HAND).any() and not clear_of(palm, T, HAND).any()
    assert clear_of(beside[:2], T, HAND).all(), "two stray points are noise"


def test_fingertips_may_not_go_below_the_support():
    tip = PANDA.gripper.finger_size[2]
    np.testing.assert_array_equal(above(0.0, np.stack([pose(z=tip), pose(z=tip + 0.01)]), HAND), [False, True])


def test_a_score_is_zero_where_the_hand_would_overlap():
    points = PointCloud(slab((-0.1, 0.1), (-0.02, 0.02), 0.05))
    across, along = Se3Pose(Vec3(0, 0, 0.04), DOWN), Se3Pose(Vec3(0, 0, 0.04), Quaternion(0, 0.5**0.5, 0.5**0.5, 0))
    good, bad = tools.score_grasps(context(), target_cloud=points, candidate_poses=[across, along]).scores
    assert good > 0.3 and bad == 0.0


def test_a_camera_that_sees_a_top_and_its_support_finds_the_sides():
    depth = np.full((120, 160), 0.6)
    depth[45:75, 65:95] = 0.54
    K, mask = Matrix3x3([[350, 0, 79.5], [0, 350, 59.5], [0, 0, 1]]), Mask(depth < 0.57)
    found = tools.plan_from_depth(context(), depth=DepthImage(depth), intrinsics=K, segmentation=mask)
    assert found.scores and found.scores[0] > 0.3
    assert max(p.position.z for p in found.grasp_poses) < 0.6


def test_the_support_is_the_plane_beside_the_target():
    floor = slab((-0.2, 0.2), (-0.2, 0.2), 0.0)
    target = slab((-0.02, 0.02), (-0.02, 0.02), 0.05)
    camera = np.diag([1.0, -1.0, -1.0])
    scene, seen = (p @ camera.T + [0, 0, 0.5] for p in (floor, target))
    T = plane_around(scene, seen, np.random.default_rng(0))
    np.testing.assert_allclose((seen @ T[:3, :3].T + T[:3, 3])[:, 2], 0.05, atol=1e-6)
    assert plane_around(scene[:10], seen, np.random.default_rng(0)) is None


def test_thinning_keeps_the_middle_of_each_cell():
    points = np.array([[0.0001, 0, 0], [0.0003, 0, 0], [0.01, 0, 0]])
    np.testing.assert_allclose(np.sort(thinned(points, 0.003)[:, 0]), [0.0002, 0.01])


@pytest.mark.parametrize("spread", [3.0, 30.0])
def test_a_stray_point_far_away_costs_no_memory(spread):
    points = np.concatenate([slab((-0.02, 0.02), (-0.02, 0.02), 0.05), [[spread, spread, 0.05]]])
    tracemalloc.start()
    try:
        assert len(closed_surface(points, 0.0).points) >= len(points)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()
