import numpy as np
import pytest

from gap_catalogue.shared.frames import KEEP, find, latest, remember
from gap_runtime.contracts.types import (
    CameraObservation,
    DepthImage,
    Image,
    Matrix3x3,
    Observation,
    Quaternion,
    Se3Pose,
    Vec3,
)


def observation(seed, stamp=0.0, cameras=2):
    rng = np.random.default_rng(seed)
    pose, K, depth = Se3Pose(Vec3(0, 0, 1), Quaternion(0, 1, 0, 0)), Matrix3x3(np.eye(3)), DepthImage(np.ones((40, 60)))
    images = [Image(rng.integers(0, 255, (40, 60, 3), dtype=np.uint8)) for _ in range(cameras)]
    frames = tuple(CameraObservation(f"c{i}", image, depth, K, pose, stamp) for i, image in enumerate(images))
    return Observation(frames, (), stamp)


@pytest.fixture
def state():
    return {}


def test_an_image_leads_back_to_its_camera(state):
    seen = observation(0)
    remember(state, seen)
    found = find(state, Image(seen.cameras[1].rgb.data.copy()))
    assert found.camera is seen.cameras[1] and found.offset == (0, 0)


def test_a_crop_leads_back_to_where_it_was_cut(state):
    seen = observation(0)
    remember(state, seen)
    found = find(state, Image(seen.cameras[1].rgb.data[5:20, 7:30]))
    assert found.camera is seen.cameras[1] and found.offset == (7, 5)


def test_an_image_with_one_pixel_changed_is_unknown(state):
    seen = observation(0)
    remember(state, seen)
    other = seen.cameras[0].rgb.data.copy()
    other[3, 3, 0] ^= 1
    assert find(state, Image(other)) is None


def test_a_flat_crop_could_be_anywhere_and_is_refused(state):
    flat = Image(np.full((40, 60, 3), 9, np.uint8))
    frame = observation(0).cameras[0]
    remember(state, Observation((CameraObservation("c", flat, frame.depth, frame.intrinsics, frame.pose),), ()))
    assert find(state, Image(np.full((10, 10, 3), 9, np.uint8))) is None


def test_nothing_is_known_before_the_first_observation(state):
    assert find(state, observation(0).cameras[0].rgb) is None and latest(state) is None


def test_only_the_latest_observations_are_kept(state):
    first = observation(0)
    remember(state, first)
    for seed in range(1, KEEP + 1):
        remember(state, observation(seed))
    assert find(state, first.cameras[0].rgb) is None
    assert latest(state).observation == observation(KEEP)


def test_the_same_observation_twice_is_one_scene(state):
    assert remember(state, observation(0)) is remember(state, observation(0))


def test_the_same_pixels_at_another_time_are_a_new_scene_with_its_own_depth(state):
    remember(state, observation(0, stamp=0.0))
    second = remember(state, observation(0, stamp=1.0))
    assert find(state, observation(0).cameras[0].rgb).scene is second
