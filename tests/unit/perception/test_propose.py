"""Where fits start: along a handle, not along the smallest rectangle, which leans."""

from __future__ import annotations

import numpy as np
import pytest

from gap_perception.scene.observed_points import ObservedPoints
from gap_perception.scene.propose import RAISED, aligned, propose, rectangle


def pan_from_above(yaw, radius=0.1, length=0.25):
    x, y = np.meshgrid(np.arange(-0.3, 0.3, 0.003), np.arange(-0.3, 0.3, 0.003))
    inside = (np.hypot(x, y) < radius) | ((x > 0) & (x < length) & (np.abs(y) < 0.012))
    c, s = np.cos(yaw), np.sin(yaw)
    flat = np.column_stack([x[inside], y[inside]]) @ np.array([[c, s], [-s, c]])
    return np.column_stack([flat + np.array([0.3, -0.2]), np.zeros(len(flat))])


@pytest.mark.parametrize("yaw", [0.0, 0.6, -1.2])
def test_a_disc_with_a_handle_is_aligned_with_its_handle(yaw):
    points = pan_from_above(yaw)
    centre, sides, angle = aligned(points)
    along = np.array([np.cos(yaw), np.sin(yaw)])
    assert abs(along @ [np.cos(angle), np.sin(angle)]) > np.cos(0.02)
    np.testing.assert_allclose(sides, [0.35, 0.2], atol=0.01)
    np.testing.assert_allclose(centre, [0.3, -0.2] + 0.075 * along, atol=0.01)
    leaning = rectangle(points)
    assert np.prod(leaning[1]) < np.prod(sides)


def test_what_would_stand_inside_the_floor_is_not_proposed(brick):
    """Speckles of a floor that a camera sees a little too high are no object whose top lies level with it."""
    top = brick.points[brick.normals[:, 2] > 0.9]
    height = brick.model.shape.size[2]
    for foot, found in ((0.0, 1), (0.05, 1), (-height, 0)):
        points = top + np.array([0.1, 0.2, foot + height / 2])
        part = ObservedPoints(points, brick.colours[brick.normals[:, 2] > 0.9], np.zeros(len(points)))
        fits = [f for f in propose({"brick": brick}, part, RAISED) if f.rest == 0]
        assert len(fits) == found, foot
