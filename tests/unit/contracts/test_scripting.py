"""The room scripts share: clouds, numbered answers, what the hand passes over."""

from __future__ import annotations

import numpy as np
import pytest

from gap_runtime.contracts.scripting import (
    GRID,
    beside_way,
    cloud_gap,
    named_index,
    numbered_question,
    points_around,
    thinned,
)
from gap_runtime.contracts.types import Obstacle, OrientedBoundingBox, Quaternion, Vec3, WorldConfig
from gap_runtime.contracts.types.geometry import BoundingBox2D

BOX = OrientedBoundingBox(Vec3(0, 0, 0), Vec3(1, 1, 1), Quaternion(1, 0, 0, 0))
RNG = np.random.default_rng(0)


def test_the_gap_between_clouds_is_symmetric_and_the_distance_they_are_apart():
    cloud = RNG.uniform(0, 0.1, (300, 3))
    assert cloud_gap(cloud, cloud) == 0
    far = cloud + np.array([0.5, 0, 0])
    assert cloud_gap(cloud, far) == cloud_gap(far, cloud) >= 0.4


def test_a_thinned_cloud_keeps_first_points_in_order_and_loses_no_place():
    cloud = RNG.uniform(0, 0.05, (5000, 3))
    thin = thinned(np.concatenate([cloud, cloud + 1e-12]))
    assert len(thin) < len(cloud) and np.array_equal(thinned(thin), thin)
    rows = [int(np.flatnonzero((cloud == point).all(axis=1))[0]) for point in thin]
    assert rows == sorted(rows)
    assert np.linalg.norm(thin - cloud[-1], axis=1).min() < GRID * np.sqrt(3)


@pytest.mark.parametrize("far", [1.0, 1e8])
def test_thinning_takes_the_first_of_every_cell_however_far_apart(far):
    cells = np.array([[0, 0, 0], [3, 1, 2], [0, 0, 0], [-4, 7, 1]])
    points = np.concatenate([(cells + 0.5) * GRID * far, [[np.nan, 0.0, 0.0]]])
    np.testing.assert_array_equal(thinned(points), points[[0, 1, 3]])
    assert thinned(points[4:]).shape == (0, 3)


@pytest.mark.parametrize(
    ("answer", "index"),
    [
        ("2", 1),
        (" Box 1.", 0),
        ("number 3", 2),
        ("none", None),
        ("4", None),
        ("0", None),
        ("the second", None),
        ("", None),
    ],
)
def test_an_answer_names_one_of_three_or_none(answer, index):
    assert named_index(answer, 3) == index


def test_a_question_numbers_its_boxes_from_one():
    text = numbered_question("{object_name}?\n{boxes}", "can", [BoundingBox2D(1, 2, 3.4, 4), BoundingBox2D(0, 0, 9, 9)])
    assert text == "can?\n1: [1, 2, 3, 4]\n2: [0, 0, 9, 9]"


def test_points_are_as_far_aside_as_they_are_from_the_way_seen_from_above():
    points = np.array([[0.5, 0.2, 9.0], [2.0, 0.0, 0.0], [-1.0, 0.0, 1.0]])
    np.testing.assert_allclose(beside_way(points, np.zeros(3), np.array([1.0, 0.0, 5.0])), [0.2, 1.0, 1.0])
    np.testing.assert_allclose(beside_way(points, np.zeros(2), np.zeros(2)), np.linalg.norm(points[:, :2], axis=1))


def test_the_target_is_no_obstacle_and_a_world_without_points_has_none():
    cloud = RNG.uniform(size=(5, 3))
    named = {"target": cloud, "box": cloud + 1, "floor": None}
    world = WorldConfig(tuple(Obstacle(name, BOX, points) for name, points in named.items()))
    assert np.array_equal(points_around(world), cloud + 1)
    assert points_around(WorldConfig(())).shape == (0, 3)
