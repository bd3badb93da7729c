"""Poses and boxes: moving, turning, measuring."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.types import OrientedBoundingBox, Quaternion, Se3Pose, Vec3

vectors = st.tuples(*[st.floats(-2, 2)] * 3)
rotations = st.builds(Rotation.from_rotvec, vectors)


@given(rotations, vectors, vectors)
def test_moving_along_own_axes_is_a_product_of_transforms(rotation, position, offset):
    pose = Se3Pose(Vec3.of(position), Quaternion.of(rotation))
    step = np.eye(4)
    step[:3, 3] = offset
    assert np.allclose(pose.moved(offset).matrix, pose.matrix @ step)


@given(rotations, vectors, rotations)
def test_turning_about_own_axes_is_a_product_of_transforms(rotation, position, by):
    pose = Se3Pose(Vec3.of(position), Quaternion.of(rotation))
    turn = np.eye(4)
    turn[:3, :3] = by.as_matrix()
    assert np.allclose(pose.turned(by).matrix, pose.matrix @ turn)


@given(rotations, vectors.filter(lambda v: np.linalg.norm(v) > 0.1))
def test_extent_along_a_direction_is_the_spread_of_the_corners(rotation, direction):
    box = OrientedBoundingBox(Vec3(1, 2, 3), Vec3(0.1, 0.2, 0.3), Quaternion.of(rotation))
    unit = np.array(direction) / np.linalg.norm(direction)
    assert np.isclose(box.extent_along(unit), np.ptp(box.corners @ unit))
