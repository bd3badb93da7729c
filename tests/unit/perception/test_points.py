import numpy as np
import pytest

from gap_perception.scene.points import lift, project
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import CameraObservation, DepthImage, Matrix3x3


def test_an_empty_floor_has_no_points(camera, floor):
    assert len(lift(camera, floor).rows) == 0


def test_a_block_on_the_floor_is_what_stands_out(look_down, floor):
    depth = np.full((120, 160), 0.8)
    depth[40:60, 70:100] = 0.75
    points = lift(look_down(depth), floor)
    assert len(points.rows) == 20 * 30
    assert np.allclose(points.height, 0.05, atol=1e-6)


def test_points_project_back_to_their_pixels(look_down, floor):
    depth = np.full((120, 160), 0.8)
    depth[40:60, 70:100] = np.linspace(0.7, 0.75, 30)
    points = lift(look_down(depth), floor)
    columns, rows, distance = project(points.xyz, points.camera)
    assert (columns == points.columns).all() and (rows == points.rows).all()
    assert np.allclose(distance, points.camera.depth.data[rows, columns], atol=1e-6)


def test_noise_on_the_floor_raises_the_margin_instead_of_points(look_down, floor):
    noisy = 0.8 + np.random.default_rng(0).normal(0, 0.002, (120, 160))
    points = lift(look_down(noisy), floor)
    assert points.noise == pytest.approx(0.002, rel=0.1)
    assert len(points.rows) < 10


def test_unknown_depth_gives_no_points(look_down, floor):
    depth = np.full((120, 160), 0.7)
    depth[:60], depth[60:] = np.nan, 0.0
    assert len(lift(look_down(depth), floor).rows) == 0


def test_points_outside_the_workspace_or_over_no_support_do_not_count(look_down, floor):
    assert len(lift(look_down(np.full((120, 160), 0.8), height=5.0), floor).rows) == 0


@pytest.mark.parametrize(("depth", "K"), [(np.ones((10, 10)), None), (None, np.zeros((3, 3)))])
def test_a_frame_that_cannot_be_is_refused(camera, floor, depth, K):
    bad = CameraObservation(
        "bad", camera.rgb, camera.depth if depth is None else DepthImage(depth),
        camera.intrinsics if K is None else Matrix3x3(K), camera.pose,
    )  # fmt: skip
    with pytest.raises(BadRequestError, match="bad"):
        lift(bad, floor)
