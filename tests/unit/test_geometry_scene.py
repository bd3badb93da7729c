"""BuildWorldConfig: what was seen is an obstacle, what is known to be none is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_geometry.scene import build_world_config, on_robot
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import (
    CameraObservation,
    DepthImage,
    Image,
    JointState,
    Mask,
    Matrix3x3,
    ObjectMask,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
)

DOWN = Se3Pose(Vec3(0.0, 0.0, 1.0), Quaternion(0.0, 1.0, 0.0, 0.0))  # a camera one metre up, looking straight down
IDENTITY = Quaternion(1.0, 0.0, 0.0, 0.0)


def camera(tall):
    """A frame over a floor at z = 0; `tall` lists (patch, height [m])."""
    depth = np.ones((120, 160))
    for patch, height in tall:
        depth[patch] = 1.0 - height
    image = Image(np.zeros((120, 160, 3), np.uint8))
    return CameraObservation(
        "top", image, DepthImage(depth), Matrix3x3([[200, 0, 79.5], [0, 200, 59.5], [0, 0, 1]]), DOWN
    )


def context(robot=None, width=0.08):
    support = SimpleNamespace(z=0.0, center=(0.0, 0.0), half_size=(1.0, 1.0))
    environment = SimpleNamespace(supports={"floor": support}, workspace=((-1, -1, -0.1), (1, 1, 1)))
    jaws = SimpleNamespace(gripper=SimpleNamespace(width=width))
    arm = SimpleNamespace(base_pose=Se3Pose(Vec3(0, 0, 0), IDENTITY), state=lambda: jaws)
    task, world = SimpleNamespace(environment=environment), SimpleNamespace(arms=[arm])
    return SimpleNamespace(task=task, cell=world, robot=lambda arm_id=0: robot)


LEFT, RIGHT = (slice(50, 70), slice(20, 40)), (slice(50, 70), slice(110, 130))
BOTH = [(LEFT, 0.10), (RIGHT, 0.05)]


def build(tall, masks=(), robot=None, **options):
    return build_world_config(context(robot), cameras=[camera(tall)], object_masks=list(masks), **options)


def test_things_apart_are_obstacles_of_their_own_and_the_floor_is_one_too():
    built = build(BOTH)
    assert built.mesh_names == ["obstacle_0", "obstacle_1", "floor"]
    tops = sorted(round(float(o.box.corners[:, 2].max()), 2) for o in built.config.obstacles)
    np.testing.assert_allclose(tops, [0.0, 0.05, 0.10], atol=0.006)


def test_even_one_pixel_is_an_obstacle():
    built = build([((slice(60, 61), slice(80, 81)), 0.2)])
    assert built.mesh_names == ["obstacle_0", "floor"]


def test_a_mask_names_its_points_and_takes_them_from_the_rest():
    pixels = np.zeros((120, 160), bool)
    pixels[LEFT] = True
    built = build(BOTH, [ObjectMask("milk", Mask(pixels), 0)])
    assert built.mesh_names == ["milk", "obstacle_0", "floor"]


def test_points_in_the_target_box_are_the_target():
    box = OrientedBoundingBox(Vec3(-0.22, 0.0, 0.05), Vec3(0.08, 0.08, 0.06), IDENTITY)
    built = build(BOTH, target_obb=box)
    assert built.mesh_names == ["target", "obstacle_0", "floor"]


def test_the_robot_is_no_obstacle():
    from gap_robots.panda import panda

    robot = panda()
    # The base link surrounds this point whatever the joints are.
    shown = [((slice(58, 62), slice(78, 82)), 0.1)]
    assert "obstacle_0" in build(shown).mesh_names
    joints = JointState(np.array(robot.home))
    assert build(shown, robot=robot, robot_joint_state=joints).mesh_names == ["floor"]


def test_the_jaws_are_left_out_where_they_are():
    from gap_catalogue.shared.robot_chain import sphere_centers
    from gap_robots import arms

    for robot in arms():
        joints = JointState(np.array(robot.home))
        for width in (0.0, robot.gripper.max_width):
            fingers = sphere_centers(robot, robot.home, width)[[("finger" in s.link) for s in robot.spheres]]
            assert len(fingers) and on_robot(context(robot, width), fingers, joints).all()
        tip = fingers[[np.argmin(fingers[:, 2])]]  # of an open finger
        assert not on_robot(context(robot, 0.0), tip, joints).any()


@pytest.mark.parametrize(
    ("masks", "options", "why"),
    [
        ([ObjectMask("x", Mask(np.ones((120, 160))), 3)], {}, "camera 3"),
        ([ObjectMask("x", Mask(np.ones((2, 2))), 0)], {}, "differ in size"),
        ([], {"voxel_size": 0.0}, "positive"),
    ],
)
def test_bad_requests_are_refused(masks, options, why):
    with pytest.raises(BadRequestError, match=why):
        build([], masks, **options)


def test_an_empty_floor_is_just_the_floor():
    assert build([]).mesh_names == ["floor"]
