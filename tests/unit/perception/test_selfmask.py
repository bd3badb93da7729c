import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_perception.scene.selfmask import LinkShape, on_robot

TURN = Rotation.from_euler("xyz", [0.3, -0.5, 1.0]).as_matrix()


@pytest.mark.parametrize(
    ("kind", "size", "inside", "outside"),
    [
        (mujoco.mjtGeom.mjGEOM_BOX, (0.1, 0.2, 0.3), (0.09, 0.19, 0.29), (0.14, 0.0, 0.0)),
        (mujoco.mjtGeom.mjGEOM_SPHERE, (0.1, 0.1, 0.1), (0.05, 0.05, 0.05), (0.08, 0.08, 0.08)),
        (mujoco.mjtGeom.mjGEOM_CAPSULE, (0.05, 0.05, 0.25), (0.0, 0.0, 0.24), (0.04, 0.04, 0.25)),
        (mujoco.mjtGeom.mjGEOM_CYLINDER, (0.05, 0.05, 0.2), (0.03, 0.03, 0.19), (0.05, 0.05, 0.0)),
    ],
)
def test_points_in_a_solid_are_the_robot_and_others_not(kind, size, inside, outside):
    solid = LinkShape(int(kind), np.array(size), TURN, np.array([1.0, 2.0, 3.0]))
    points = np.array([inside, outside]) @ TURN.T + solid.position
    assert on_robot(points, [solid], margin=0.01).tolist() == [True, False]


def test_the_margin_reaches_beyond_the_solid():
    solid = LinkShape(int(mujoco.mjtGeom.mjGEOM_BOX), np.full(3, 0.1), np.eye(3), np.zeros(3))
    points = np.array([[0.11, 0, 0]])
    assert on_robot(points, [solid], margin=0.02).all() and not on_robot(points, [solid], margin=0.005).any()
