import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_perception.scene.points import lift
from gap_runtime.contracts.types import CameraObservation, Se3Pose


def misplaced(camera, turn_deg=(0.0, 0.0, 0.0), rise=0.0):
    T = camera.pose.matrix
    T[:3, :3] = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix() @ T[:3, :3]
    T[2, 3] += rise
    return CameraObservation(camera.name, camera.rgb, camera.depth, camera.intrinsics, Se3Pose.of(T))


@pytest.fixture
def scene(look_down):
    depth = np.full((120, 160), 0.8)
    depth[40:60, 70:100] = 0.75
    return look_down(depth)


@pytest.mark.parametrize(
    ("turn", "rise"), [((0.5, -0.3, 0.0), 0.004), ((0.0, 0.0, 0.0), -0.006), ((-0.4, 0.4, 0.0), 0.0)]
)
def test_a_tilted_camera_is_levelled_by_the_floor(scene, floor, turn, rise):
    points = lift(misplaced(scene, turn, rise), floor)
    assert len(points.rows) == 20 * 30
    assert np.allclose(points.height, 0.05, atol=3e-4)
    assert points.tilt > 0.001


def test_a_calibrated_camera_is_left_alone(scene, floor):
    points = lift(scene, floor)
    assert points.camera is scene and points.tilt < 1e-5


def test_objects_on_half_the_floor_do_not_tilt_it(look_down, floor):
    depth = np.full((120, 160), 0.8)
    depth[:, 90:] = 0.78
    points = lift(look_down(depth), floor)
    assert np.allclose(points.height, 0.02, atol=3e-4)


def test_a_camera_that_sees_no_floor_cannot_be_levelled(look_down, floor):
    points = lift(look_down(np.full((120, 160), 0.5)), floor)
    assert points.tilt == 0 and np.allclose(points.height, 0.3)
