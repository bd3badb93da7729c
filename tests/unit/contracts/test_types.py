import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.types import (
    CONTRACT_TYPES,
    DepthImage,
    Image,
    JointState,
    Mask,
    Matrix3x3,
    Obstacle,
    OrientedBoundingBox,
    PointCloud,
    Quaternion,
    Se3Pose,
    Trajectory,
    Vec3,
)
from tests.unit.contracts.strategies import values

rotations = st.tuples(*[st.floats(-6, 6)] * 3).map(Rotation.from_rotvec)
IDENTITY = Quaternion(1, 0, 0, 0)


def arrays_of(value):
    return [v for v in vars(value).values() if isinstance(v, np.ndarray)]


@pytest.mark.parametrize("name", CONTRACT_TYPES)
@settings(max_examples=5, deadline=None)
@given(data=st.data())
def test_a_copy_is_equal_and_as_unchangeable_as_the_original(name, data):
    value = data.draw(values(name))
    for twin in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert twin == value
        assert not any(a.flags.writeable for a in arrays_of(twin))


def test_a_value_is_not_changed_by_changing_what_it_was_made_of():
    points = np.zeros((2, 3))
    cloud = PointCloud(points)
    points[:] = 1
    assert np.all(cloud.points == 0)
    part = points[:1]
    box = Obstacle("x", OrientedBoundingBox(Vec3(0, 0, 0), Vec3(1, 1, 1), IDENTITY), part)
    points[:] = 2
    assert np.all(box.points == 1)


def test_arrays_and_fields_cannot_be_written_to():
    cloud = PointCloud([[0, 0, 0]])
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0] = 1
    with pytest.raises(AttributeError):
        cloud.points = None


def test_values_are_equal_element_by_element_and_only_within_a_type():
    assert PointCloud([[0, 0, 0]]) == PointCloud(np.zeros((1, 3)))
    assert PointCloud([[0, 0, 0]]) != PointCloud([[0, 0, 1]])
    assert PointCloud([[0, 0, 0]]) != PointCloud([[0, 0, 0]], [[0, 0, 0]])
    assert DepthImage([[np.nan]]) == DepthImage([[np.nan]])
    assert Matrix3x3(np.eye(3)) != Mask(np.eye(3))
    with pytest.raises(TypeError, match="unhashable"):
        hash(Vec3(0, 0, 0))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Image(np.zeros((2, 2))), "Image.data must have shape NxNx3, got 2x2"),
        (lambda: Image(np.full((1, 1, 3), 0.5)), "Image.data must be uint8"),
        (lambda: Image(np.full((1, 1, 3), 300)), "Image.data must be uint8"),
        (lambda: Image(np.full((1, 1, 3), -1)), "Image.data must be uint8"),
        (lambda: Image([[["a", "b", "c"]]]), "must be numbers"),
        (lambda: Mask(np.full((1, 1), 0.5)), "Mask.data must be bool"),
        (lambda: Mask(3), "got a scalar"),
        (lambda: DepthImage(np.zeros((1, 1), dtype=complex)), "must be numbers"),
        (lambda: PointCloud(np.zeros((3, 2))), "must have shape Nx3, got 3x2"),
        (lambda: PointCloud([[None] * 3]), "must be numbers"),
        (lambda: Matrix3x3(np.eye(4)), "must have shape 3x3"),
        (lambda: JointState([[0.0]]), "JointState.positions must have shape N"),
        (lambda: JointState([0.0], efforts=np.zeros((1, 1))), "JointState.efforts"),
        (lambda: Trajectory([0, 1], np.zeros((3, 7))), "Trajectory.positions must have shape 2xN, got 3x7"),
        (lambda: Quaternion(0, 0, 0, 0), "unit norm, got 0"),
        (lambda: Quaternion(1, 1, 0, 0), "unit norm, got 1.41421"),
        (lambda: Quaternion(np.nan, 0, 0, 0), "unit norm, got nan"),
    ],
)
def test_what_does_not_fit_is_named(make, said):
    with pytest.raises(ValueError, match=said):
        make()


@pytest.mark.parametrize(
    ("value", "dtype"),
    [
        (Image(np.full((1, 1, 3), 255.0)).data, np.uint8),
        (Mask(np.array([[0, 255]], dtype=np.uint8)).data, np.bool_),
        (DepthImage([[1, 2]]).data, np.float32),
        (PointCloud([[1, 2, 3]]).points, np.float64),
    ],
)
def test_numbers_that_mean_the_same_are_taken_in_the_type_of_the_contract(value, dtype):
    assert value.dtype == dtype


def test_a_depth_too_large_for_its_type_is_infinite_without_a_warning():
    assert np.isinf(DepthImage([[1e300]]).data).all()


@given(rotations)
def test_equal_rotations_are_equal_quaternions(rotation):
    assert Quaternion.of(rotation).w >= 0
    twice = Quaternion.of(Rotation.from_quat(-rotation.as_quat()))
    assert np.allclose(twice.rotation.as_matrix(), Quaternion.of(rotation).rotation.as_matrix())


@given(rotations, st.tuples(*[st.floats(-10, 10)] * 3))
def test_a_pose_is_its_matrix(rotation, position):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation.as_matrix(), position
    assert np.allclose(Se3Pose.of(T).matrix, T)


@given(rotations)
def test_corners_of_a_box_are_as_far_from_its_centre_as_its_extent_is_long(rotation):
    box = OrientedBoundingBox(Vec3(1, 2, 3), Vec3(0.1, 0.2, 0.3), Quaternion.of(rotation))
    assert box.corners.shape == (8, 3)
    assert np.allclose(box.corners.mean(axis=0), [1, 2, 3])
    assert np.allclose(np.linalg.norm(box.corners - [1, 2, 3], axis=1), np.linalg.norm([0.1, 0.2, 0.3]))


def test_a_trajectory_lasts_from_its_first_to_its_last_time():
    assert Trajectory([1, 4], np.zeros((2, 7))).duration == 3
    assert Trajectory([], np.zeros((0, 7))).duration == 0
