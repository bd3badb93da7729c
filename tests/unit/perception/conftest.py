"""A box with six differently coloured faces as an object model, and a camera that looks at a plane with it on top."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_perception.scene.library import fuse
from gap_runtime.contracts.task import Environment, ObjectModel, Shape, Support
from gap_runtime.contracts.types import CameraObservation, DepthImage, Image, Matrix3x3, Se3Pose

SIZE = (0.08, 0.05, 0.03)


def box_model(name="brick", size=SIZE):
    return ObjectModel(label=name, shape=Shape(kind="box", size=size), mass=0.1)


def box_surface(size=SIZE, step=0.002):
    """Points, normals and CIELAB-like colours of a box; each face has a colour of its own."""
    half, parts = np.array(size) / 2, []
    for axis in range(3):
        u, v = (i for i in range(3) if i != axis)
        a, b = np.meshgrid(*(np.arange(-half[i] + step / 2, half[i], step) for i in (u, v)))
        for sign in (-1, 1):
            points = np.zeros((a.size, 3))
            points[:, u], points[:, v], points[:, axis] = a.ravel(), b.ravel(), sign * half[axis]
            normals = np.tile(sign * np.eye(3)[axis], (a.size, 1))
            parts.append((points, normals, np.tile([50.0, 30.0 * (axis - 1), 40.0 * sign], (a.size, 1))))
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


@pytest.fixture
def brick():
    points, normals, colours = box_surface()
    return fuse("brick", box_model(), points, normals, colours, np.ones(len(points)))


@pytest.fixture
def floor():
    return Environment(supports={"floor": Support(z=0.0, half_size=(1, 1))}, workspace=((-1, -1, 0), (1, 1, 1)))


@pytest.fixture
def camera():
    """Looks straight down from 0.8 m at an empty floor, 120 x 160 pixels."""
    return looking_down(np.full((120, 160), 0.8))


def looking_down(depth, rgb=None, height=0.8):
    rows, columns = depth.shape
    T = np.eye(4)
    T[:3, :3], T[2, 3] = Rotation.from_euler("x", 180, degrees=True).as_matrix(), height
    K = [[200, 0, (columns - 1) / 2], [0, 200, (rows - 1) / 2], [0, 0, 1]]
    image = np.full((rows, columns, 3), 128, np.uint8) if rgb is None else rgb
    return CameraObservation("top", Image(image), DepthImage(depth), Matrix3x3(K), Se3Pose.of(T))


@pytest.fixture
def look_down():
    return looking_down
