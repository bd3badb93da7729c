import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_perception.scene.fit import Fit, fit, resting_size, rests
from gap_perception.scene.match import evaluate_match, symmetries
from gap_perception.scene.observed_points import ObservedPoints
from gap_perception.scene.visibility import agreement, depth_view

YAW, SPOT = 0.7, np.array([0.12, -0.3])


@pytest.fixture
def seen(brick):
    """Points and colours of the brick's top and two sides, standing on a floor at 0.1 m."""
    R = Rotation.from_euler("z", YAW).as_matrix()
    shown = (brick.normals @ [0.6, 0.5, 0.6]) > 0.1
    points = brick.points[shown] @ R.T + [*SPOT, 0.1 + brick.model.shape.size[2] / 2]
    return points[::3], brick.colours[shown][::3]


def test_the_pose_is_found_from_a_start_nearby(brick, seen):
    found = fit(brick, 0, seen[0], np.array([[*(SPOT + 0.012), YAW + 0.2]]), 0.1)
    assert np.allclose(found.position[:2], SPOT, atol=3e-4)
    assert np.allclose(found.rotation, Rotation.from_euler("z", YAW).as_matrix(), atol=5e-3)
    assert found.distance.max() < 1e-3


def test_the_best_of_several_starts_wins(brick, seen):
    starts = np.array([[*(SPOT + 0.3), 0.0], [*(SPOT - 0.01), YAW], [*(SPOT + np.array([0.0, 0.2])), 1.0]])
    assert np.allclose(fit(brick, 0, seen[0], starts, 0.1).position[:2], SPOT, atol=3e-4)


def test_the_height_of_the_support_is_trusted(brick, seen):
    found = fit(brick, 0, seen[0] + [0, 0, 0.0005], np.array([[*SPOT, YAW]]), 0.1)
    assert abs(found.position[2] - 0.115) < 0.0005


def test_a_raised_object_is_found_at_its_own_height(brick, seen):
    found = fit(brick, 0, seen[0] + [0, 0, 0.2], np.array([[*SPOT, YAW]]), 0.1, free=True)
    assert np.allclose(found.position, [*SPOT, 0.315], atol=5e-4)


def test_resting_sizes_are_the_sides_turned(brick):
    size = np.array(brick.model.shape.size)
    for rest, R in enumerate(rests("box")):
        assert np.allclose(np.sort(resting_size(brick, rest)), np.sort(size))
        assert np.isclose(resting_size(brick, rest)[2], size[np.argmax(np.abs(R[2]))])


@pytest.fixture
def top_view(brick, look_down):
    """Depth of the brick on its floor from straight above."""
    surface, depth = (
        Fit(brick, 0, Rotation.from_euler("z", YAW).as_matrix(), np.array([*SPOT, 0.115]), np.zeros(0)),
        0.7,
    )
    camera = look_down(np.full((240, 240), depth))
    K, v_u = camera.intrinsics.data, np.indices((240, 240)).reshape(2, -1)
    x, y = (v_u[1] - K[0, 2]) / K[0, 0], (v_u[0] - K[1, 2]) / K[1, 1]
    on_top = np.column_stack([0.67 * x, -0.67 * y, np.full(x.shape, 0.13)])
    covered = (np.abs(surface.local(on_top)) <= np.array(brick.model.shape.size) / 2 + 1e-9).all(axis=1)
    return depth_view(look_down(np.where(covered, 0.67, depth).reshape(240, 240)))


def test_a_camera_confirms_the_right_place_and_sees_through_a_wrong_one(brick, seen, top_view):
    right = fit(brick, 0, seen[0], np.array([[*SPOT, YAW]]), 0.1)
    wrong = Fit(brick, 0, right.rotation, right.position + np.array([0.1, 0, 0]), right.distance)
    assert agreement(right, [top_view]).share > 0.8
    assert agreement(wrong, [top_view]).share < 0.2


def test_colours_tell_the_front_from_the_back(brick, seen, top_view):
    turned = fit(brick, 0, seen[0], np.array([[*SPOT, YAW + np.pi]]), 0.1)
    match = evaluate_match(turned, ObservedPoints(*seen, np.full(len(seen[0]), 0.1)), [top_view])
    assert np.allclose(match.fit.rotation, Rotation.from_euler("z", YAW).as_matrix(), atol=1e-2)


def test_symmetries_keep_the_outline(brick):
    half = np.array(brick.model.shape.size) / 2
    for standing in (True, False):
        for turn in symmetries(brick, standing=standing):
            assert np.allclose(np.abs(turn) @ half, half)
