"""Antipodal grasps: they fit the jaws, clear the support and the neighbours, hold in both friction cones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_grasps import tools
from gap_grasps.sampling import FRICTION
from gap_robots.panda import panda
from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.types import DepthImage, Mask, Matrix3x3, PointCloud, Quaternion, Se3Pose, Vec3

PANDA = panda()
SIDEWAYS = np.sin(np.arctan(FRICTION))  # how far a closing line may lean


def context(seed=0):
    support = SimpleNamespace(z=0.0, center=(0.0, 0.0), half_size=(1.0, 1.0))
    task = SimpleNamespace(environment=SimpleNamespace(supports={"floor": support}))
    return SimpleNamespace(seed=seed, task=task, robot=lambda arm_id=0: PANDA)


def box(size, center=(0.0, 0.0), spacing=0.003, faces="all"):
    """Surface points of a box standing on z = 0."""
    half = np.array(size) / 2
    axes = [np.arange(-h + spacing / 2, h, spacing) for h in half]
    sides = []
    for fixed in range(3):
        others = [a for i, a in enumerate(axes) if i != fixed]
        grid = np.stack([g.ravel() for g in np.meshgrid(*others)], axis=1)
        for sign in (-1, 1):
            if faces == "front" and (fixed, sign) not in {(0, 1), (2, 1)}:
                continue
            sides.append(np.insert(grid, fixed, sign * half[fixed], axis=1))
    return np.concatenate(sides) + np.array([*center, half[2]])


def grasp(points, **options):
    return tools.plan_from_point_cloud(context(), target_cloud=PointCloud(points), **options)


def widths(points, poses):
    """How far apart the surface is along each pose's closing line, near the TCP."""
    for pose in poses:
        local = (points - pose.position.array) @ pose.matrix[:3, :3]
        between = (np.abs(local[:, 0]) < 0.009) & (np.abs(local[:, 2]) < 0.01) & (np.abs(local[:, 1]) < 0.06)
        yield np.ptp(local[between, 1])


@pytest.mark.parametrize("faces", ["all", "front"])
def test_a_long_box_is_taken_across_the_side_that_fits(faces):
    points = box((0.04, 0.12, 0.06), faces=faces)
    found = grasp(points)
    assert len(found.grasp_poses) > 5
    closing = np.array([p.matrix[:3, 1] for p in found.grasp_poses])
    assert (np.abs(closing[:, 1]) < SIDEWAYS).all(), "0.12 m does not fit 0.08 m jaws"


def test_no_grasp_is_wider_than_the_jaws_open():
    points = box((0.05, 0.05, 0.1))
    assert max(widths(points, grasp(points).grasp_poses)) <= PANDA.gripper.max_width


def test_what_is_too_wide_has_no_grasp():
    assert grasp(box((0.12, 0.12, 0.12))).grasp_poses == []


def test_scores_are_sorted_and_between_zero_and_one():
    scores = grasp(box((0.04, 0.06, 0.08))).scores
    assert scores == sorted(scores, reverse=True) and scores[-1] > 0 and scores[0] <= 1


def test_fingertips_stay_above_the_support():
    for pose in grasp(box((0.05, 0.08, 0.018))).grasp_poses:
        assert pose.position.z - PANDA.gripper.finger_size[2] * abs(pose.matrix[2, 2]) > 0


def test_a_neighbour_against_one_side_leaves_the_other_pair_of_sides():
    target, wall = box((0.05, 0.05, 0.08)), box((0.03, 0.3, 0.08), center=(0.043, 0.0))
    scene = PointCloud(np.concatenate([target, wall]))
    closing = np.array([p.matrix[:3, 1] for p in grasp(target, scene_cloud=scene).grasp_poses])
    assert len(closing) and (np.abs(closing[:, 0]) < 0.5).all(), "a finger would have to enter the wall"


def test_given_poses_are_scored_by_the_same_measure():
    points = PointCloud(box((0.04, 0.06, 0.08)))
    found = tools.plan_from_point_cloud(context(), target_cloud=points)
    again = tools.score_grasps(context(), target_cloud=points, candidate_poses=found.grasp_poses).scores
    np.testing.assert_allclose(again, found.scores, atol=1e-9)
    nowhere = Se3Pose(Vec3(1, 1, 1), Quaternion(1, 0, 0, 0))
    assert tools.score_grasps(context(), target_cloud=points, candidate_poses=[nowhere]).scores == [0.0]


def test_the_same_seed_gives_the_same_grasps():
    points = box((0.04, 0.06, 0.08))
    assert grasp(points) == grasp(points)


def test_depth_and_cloud_agree_in_the_camera_frame():
    depth = np.full((60, 80), 1.0)
    depth[20:40, 30:50] = 0.9
    K, image, mask = Matrix3x3([[400, 0, 39.5], [0, 400, 29.5], [0, 0, 1]]), DepthImage(depth), Mask(depth < 0.95)
    found = tools.plan_from_depth(context(), depth=image, intrinsics=K, segmentation=mask)
    for pose in found.grasp_poses:
        assert pose.matrix[2, 2] > 0, "the hand comes from the camera's side"


def test_everything_on_the_table_can_be_asked_for_at_once():
    scene = PointCloud(np.concatenate([box((0.04, 0.06, 0.08)), box((0.04, 0.06, 0.08), center=(0.3, 0.0))]))
    x = np.array([p.position.x for p in tools.plan_in_scene(context(), scene_cloud=scene).grasp_poses])
    assert (x < 0.15).any() and (x > 0.15).any()


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros((1, 3)), np.full((100, 3), np.nan)])
def test_a_cloud_without_a_surface_is_refused(points):
    with pytest.raises(PerceptionError, match="do not show a surface"):
        grasp(points)


def test_bad_requests_are_refused():
    K = Matrix3x3(np.eye(3))
    with pytest.raises(BadRequestError, match="size"):
        tools.plan_from_depth(
            context(), depth=DepthImage(np.ones((4, 4))), intrinsics=K, segmentation=Mask(np.ones((5, 5)))
        )
    with pytest.raises(BadRequestError, match="instance"):
        tools.plan_from_depth(
            context(),
            depth=DepthImage(np.ones((4, 4))),
            intrinsics=K,
            segmentation=Mask(np.ones((4, 4))),
            instance_id=2,
        )
    with pytest.raises(BadRequestError, match="num_grasps is 0"):
        grasp(box((0.04, 0.06, 0.08)), num_grasps=0)


EMPTY, ONE, UNKNOWN = (PointCloud(p) for p in (np.zeros((0, 3)), np.zeros((1, 3)), np.full((100, 3), np.nan)))


@pytest.mark.parametrize("cloud", [EMPTY, ONE, UNKNOWN], ids=["empty", "one point", "NaN"])
@pytest.mark.parametrize(
    "call",
    [
        lambda c: tools.score_grasps(context(), target_cloud=c, candidate_poses=[]),
        lambda c: tools.plan_from_clouds(context(), full_cloud=PointCloud(box((0.04, 0.06, 0.08))), segment_cloud=c),
        lambda c: tools.plan_from_clouds(context(), full_cloud=c, segment_cloud=c),
        lambda c: tools.plan_in_scene(context(), scene_cloud=c),
        lambda c: tools.plan_in_scene(context(), scene_cloud=PointCloud(box((0.04, 0.06, 0.08))), target_cloud=c),
    ],
    ids=["score", "camera", "camera, nothing around", "scene", "target in a scene"],
)
def test_every_tool_says_when_a_cloud_shows_nothing(call, cloud):
    with pytest.raises(PerceptionError, match="do not show a surface"):
        call(cloud)


def test_no_candidates_have_no_scores_and_impossible_ones_are_refused():
    points = PointCloud(box((0.04, 0.06, 0.08)))
    assert tools.score_grasps(context(), target_cloud=points, candidate_poses=[]).scores == []
    with pytest.raises(BadRequestError, match="finite"):
        tools.score_grasps(
            context(),
            target_cloud=points,
            candidate_poses=[Se3Pose(Vec3(float("nan"), 0.0, 0.1), Quaternion(0.0, 1.0, 0.0, 0.0))],
        )


def test_a_scene_with_nothing_but_nan_is_no_obstacle():
    points = box((0.04, 0.06, 0.08))
    assert grasp(points, scene_cloud=UNKNOWN) == grasp(points, scene_cloud=EMPTY)
