"""Bodies at any tilt, and bodies that cannot be where others are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_perception.scene.fit import Fit
from gap_perception.scene.interpenetration import interpenetrate
from gap_perception.scene.observed_points import ObservedPoints
from gap_perception.scene.tilt_fit import fit_tilted
from gap_perception.scene.visibility import depth_view

PLACE = np.array([0.1, -0.2, 0.16])


def at(brick, rotation, position):
    return Fit(brick, 0, rotation, np.asarray(position), np.zeros(0))


@pytest.fixture
def view(look_down):
    return depth_view(look_down(np.full((40, 40), 0.7)))


def seen_from(view, brick, R):
    to_eye = view.camera.pose.position.array - PLACE
    shown = (brick.normals @ (R.T @ to_eye)) > 0.1 * np.linalg.norm(to_eye)
    points = brick.points[shown] @ R.T + PLACE
    return ObservedPoints(points, brick.colours[shown], np.full(len(points), 0.05))


@pytest.mark.parametrize("tilt", [20, 35, 50])
@pytest.mark.parametrize("towards", [0.3, 2.0])
def test_a_tilted_body_is_found_at_its_tilt(brick, view, tilt, towards):
    axis = np.array([np.cos(towards), np.sin(towards), 0.0])
    R = (Rotation.from_rotvec(np.radians(tilt) * axis) * Rotation.from_euler("z", 0.4)).as_matrix()
    (found,) = fit_tilted({"brick": brick}, seen_from(view, brick, R), [view])
    half = np.array(brick.model.shape.size) / 2
    assert np.allclose(found.position, PLACE, atol=2e-3)
    assert np.allclose(np.abs(found.rotation) @ half, np.abs(R) @ half, atol=4e-3)


def test_no_fit_sinks_into_the_support(brick, view):
    part = seen_from(view, brick, np.eye(3))
    assert fit_tilted({"brick": brick}, replace(part, support=part.support + 0.2), [view]) == []


def test_only_bodies_in_one_place_collide(brick):
    length, _, height = brick.model.shape.size
    first = at(brick, np.eye(3), [0, 0, 0])
    assert interpenetrate(first, at(brick, np.eye(3), [length / 4, 0, height / 2 - 0.003]))
    assert interpenetrate(first, at(brick, Rotation.from_euler("y", 30, degrees=True).as_matrix(), [0, 0.01, 0]))
    assert not interpenetrate(first, at(brick, np.eye(3), [length, 0, 0]))
    assert not interpenetrate(first, at(brick, np.eye(3), [0, 0, height - 0.002]))
