"""geometry_svc.*: identities of back-projection, boxes and grasps, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gap_geometry import boxes, clouds, grasps, placement
from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.types import (
    DepthImage,
    Mask,
    Matrix3x3,
    OrientedBoundingBox,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
)

K = Matrix3x3([[500, 0, 31.5], [0, 500, 23.5], [0, 0, 1]])
ANY_POSE = Se3Pose(Vec3(0.3, -0.2, 0.8), Quaternion.of(Rotation.from_euler("xyz", [2.5, 0.2, -1.0])))
SMALL = Mask(np.ones((2, 2)))
IDENTITY = Se3Pose(Vec3(0, 0, 0), Quaternion(1, 0, 0, 0))


def box_cloud(center, half, yaw, n=1500, seed=0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (n, 3))
    face = rng.integers(0, 3, n)
    points[np.arange(n), face] = np.sign(points[np.arange(n), face])
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    points = np.concatenate([points, corners]) * half
    return PointCloud(Rotation.from_euler("z", yaw).apply(points) + center)


def depth_image(value=0.7):
    return DepthImage(np.full((48, 64), value))


def test_back_projected_points_project_to_their_own_pixels():
    points = clouds.depth_to_point_cloud(None, depth=depth_image(), intrinsics=K).points
    uv = points @ K.data.T
    v, u = np.mgrid[:48, :64]
    np.testing.assert_allclose(uv[:, :2] / uv[:, 2:], np.column_stack([u.ravel(), v.ravel()]), atol=1e-9)


def test_a_mask_and_a_pixel_agree_in_the_world():
    mask = np.zeros((48, 64), bool)
    mask[10, 20] = True
    cloud = clouds.mask_to_world_points(None, mask=Mask(mask), depth=depth_image(), intrinsics=K, camera_pose=ANY_POSE)
    point = clouds.pixel_to_world_point(
        None, pixel_x=20, pixel_y=10, depth=depth_image(), intrinsics=K, camera_pose=ANY_POSE
    )
    np.testing.assert_allclose(cloud.points[0], point.array)


def test_a_transform_and_its_inverse_cancel():
    cloud = box_cloud([0, 0, 0], [0.1, 0.2, 0.3], 0.3, n=50)
    inverse = Se3Pose.of(np.linalg.inv(ANY_POSE.matrix))
    there = clouds.transform_points(None, point_cloud=cloud, transform=ANY_POSE)
    np.testing.assert_allclose(
        clouds.transform_points(None, point_cloud=there, transform=inverse).points, cloud.points, atol=1e-12
    )


def test_pixels_without_depth_give_no_points():
    depth = np.full((48, 64), np.nan)
    depth[0, :3] = [0.0, np.inf, 0.5]
    assert len(clouds.depth_to_point_cloud(None, depth=DepthImage(depth), intrinsics=K).points) == 1


def test_noise_is_dropped_and_every_cluster_stays():
    one, two = box_cloud([0, 0, 0], [0.02] * 3, 0), box_cloud([0.2, 0, 0], [0.02] * 3, 0)
    stray = np.array([[0.1, 0.1, 0.1]])
    kept = clouds.filter_noise(None, point_cloud=PointCloud(np.concatenate([one.points, stray, two.points]))).points
    assert not (kept == stray).all(axis=1).any()
    assert (kept[:, 0] < 0.1).any() and (kept[:, 0] > 0.1).any()


@settings(deadline=None)  # the first call loads scikit-learn
@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 400),
    spread=st.floats(0.002, 0.1),
    eps=st.sampled_from([0.0021, 0.0055, 0.0205]),
    min_samples=st.sampled_from([1, 2, 10, 401]),
    grid=st.booleans(),
)
def test_noise_is_what_dbscan_calls_noise(seed, count, spread, eps, min_samples, grid):
    points = np.random.default_rng(seed).normal(0, spread, (count, 3))
    points = np.round(points, 3) if grid else points  # rounded: many at exactly the same place
    noise = clouds.cluster(points, eps, min_samples) < 0
    assert (clouds.is_noise(points, eps, min_samples) == noise).all()


@given(
    x=st.floats(-0.5, 0.5),
    y=st.floats(-0.5, 0.5),
    yaw=st.floats(-1.5, 1.5),
    short=st.floats(0.02, 0.1),
    ratio=st.floats(1.2, 3),
    height=st.floats(0.01, 0.1),
)
def test_a_box_is_recovered_with_its_long_side_along_x(x, y, yaw, short, ratio, height):
    half = np.array([short * ratio, short, height])
    obb = boxes.compute_obb(None, point_cloud=box_cloud([x, y, height], half, yaw))
    np.testing.assert_allclose(obb.center.array, [x, y, height], atol=1e-4)
    np.testing.assert_allclose(obb.extent.array, half, atol=1e-4)
    axis = obb.orientation.rotation.apply([1, 0, 0])
    assert abs(axis[:2] @ [np.cos(yaw), np.sin(yaw)]) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("yaw", [-0.7, -0.3, 0.0, 0.4, 0.78])
def test_a_square_box_does_not_flip_under_noise(yaw):
    cloud = box_cloud([0, 0, 0], [0.03, 0.03, 0.05], yaw)
    rng = np.random.default_rng(1)
    axes = []
    for _ in range(5):
        noisy = PointCloud(cloud.points + rng.normal(0, 2e-4, cloud.points.shape))
        axes.append(boxes.compute_obb(None, point_cloud=noisy).orientation.rotation.apply([1, 0, 0]))
    assert min(np.dot(a, b) for a in axes for b in axes) > 0.99


def test_jaws_close_across_the_shorter_side():
    obb = boxes.compute_obb(None, point_cloud=box_cloud([0.1, 0.2, 0.05], [0.06, 0.02, 0.05], 0.5))
    pose = grasps.top_down_grasp_from_obb(None, obb=obb)
    approach, closing = pose.rotation.rotation.apply([[0, 0, 1], [0, 1, 0]])
    np.testing.assert_allclose(approach, [0, 0, -1], atol=1e-12)
    assert abs(closing @ obb.orientation.rotation.apply([0, 1, 0])) == pytest.approx(1)
    np.testing.assert_allclose(pose.position.array, obb.center.array)


def test_an_aligned_box_is_grasped_in_the_standard_top_down_orientation():
    obb = OrientedBoundingBox(Vec3(0, 0, 0), Vec3(0.05, 0.02, 0.02), Quaternion(1, 0, 0, 0))
    assert grasps.top_down_grasp_from_obb(None, obb=obb).rotation == Quaternion(0, 1, 0, 0)


def test_candidates_differ_by_a_quarter_turn():
    obb = OrientedBoundingBox(Vec3(0, 0, 0), Vec3(0.05, 0.02, 0.02), Quaternion(1, 0, 0, 0))
    first, second = grasps.top_down_grasp_candidates(None, obb=obb).poses
    assert (first.rotation.rotation.inv() * second.rotation.rotation).magnitude() == pytest.approx(np.pi / 2)
    assert second.rotation == grasps.rotate_quat_z90(None, quat=first.rotation)


def test_selection_prefers_top_down_then_near():
    def pose(tilt, x):
        return Se3Pose(Vec3(x, 0, 0), Quaternion.of(Rotation.from_euler("x", np.pi - tilt)))

    tilted, far, near = pose(0.5, 0), pose(0, 1), pose(0, 0.5)
    assert grasps.select_top_down_grasp(None, grasp_poses=[tilted, far, near], gripper_position=Vec3(0, 0, 0)) == near


def test_a_front_grasp_comes_from_where_the_hint_says():
    handle = OrientedBoundingBox(Vec3(0.5, 0, 0.3), Vec3(0.01, 0.06, 0.01), Quaternion(1, 0, 0, 0))
    grasp = grasps.front_grasp_from_obb(None, obb=handle, approach_offset=0.08, approach_hint=Vec3(1, 0.1, 0))
    np.testing.assert_allclose(grasp.approach_direction.array, [1, 0, 0])
    np.testing.assert_allclose(grasp.grasp_pose.position.array - grasp.pre_grasp_pose.position.array, [0.08, 0, 0])
    closing = grasp.grasp_pose.rotation.rotation.apply([0, 1, 0])
    assert abs(closing[2]) == pytest.approx(1), "a horizontal bar is taken from above and below"


def test_the_drop_position_clears_the_rim_by_the_clearance():
    basket = OrientedBoundingBox(Vec3(0, 0.26, 0.08), Vec3(0.088, 0.088, 0.08), Quaternion(1, 0, 0, 0))
    drop = placement.compute_drop_position(None, container_obb=basket, clearance=0.05, object_z_extent=0.038)
    assert drop.z - 0.038 - 0.16 == pytest.approx(0.05)


def test_distance_ignores_height():
    assert placement.compute_xy_distance(None, point_a=Vec3(0, 0, 5), point_b=Vec3(3, 4, -5)).distance == 5


FRAME = {"intrinsics": K, "camera_pose": IDENTITY}
BLIND = Matrix3x3(np.zeros((3, 3)))
pixel = clouds.pixel_to_world_point


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: boxes.compute_obb(None, point_cloud=PointCloud(np.zeros((0, 3)))), PerceptionError),
        (lambda: boxes.compute_obb(None, point_cloud=PointCloud(np.full((9, 3), np.nan))), PerceptionError),
        (lambda: clouds.filter_noise(None, point_cloud=PointCloud([[0, 0, 0]])), PerceptionError),
        (lambda: clouds.mask_to_world_points(None, mask=SMALL, depth=depth_image(), **FRAME), BadRequestError),
        (lambda: pixel(None, pixel_x=64, pixel_y=0, depth=depth_image(), **FRAME), BadRequestError),
        (lambda: pixel(None, pixel_x=0, pixel_y=0, depth=depth_image(np.nan), **FRAME), PerceptionError),
        (lambda: clouds.depth_to_point_cloud(None, depth=depth_image(), intrinsics=BLIND), BadRequestError),
        (lambda: grasps.select_top_down_grasp(None, grasp_poses=[], gripper_position=Vec3(0, 0, 0)), BadRequestError),
        (lambda: placement.compute_drop_position(None, container_obb=None, clearance=float("nan")), BadRequestError),
    ],
)  # fmt: skip
def test_bad_input_is_a_typed_error(call, error):
    with pytest.raises(error):
        call()
