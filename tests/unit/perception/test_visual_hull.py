from collections import Counter

import numpy as np
import pytest

from gap_perception.models.mesh_views import MaskedView
from gap_perception.models.visual_hull import build_mesh, mesh_surface, visual_hull
from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.types import DepthImage, OrientedBoundingBox, Quaternion, Vec3

UPRIGHT = Quaternion(1.0, 0.0, 0.0, 0.0)
BOX = OrientedBoundingBox(Vec3(0.0, 0.0, 0.05), Vec3(0.1, 0.1, 0.05), UPRIGHT)


def directed_edges(faces):
    return Counter(map(tuple, np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])))


def volume(vertices, faces):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6)


def view_of(look_down, depth):
    camera = look_down(depth)
    return MaskedView(camera, camera.depth.data < 0.79)


@pytest.fixture
def step(look_down):
    """Left half of the box is full, right half only half as high, seen from above."""
    depth = np.full((240, 240), 0.8)
    u = (np.arange(240) - 119.5) / 200
    depth[np.ix_(np.abs(u * 0.7) <= 0.1, (u * 0.7 >= -0.1) & (u < 0))] = 0.7
    depth[np.ix_(np.abs(u * 0.75) <= 0.1, (u * 0.75 <= 0.1) & (u >= 0))] = 0.75
    return view_of(look_down, depth)


@pytest.mark.parametrize("seed", range(3))
def test_any_voxels_wrap_into_a_closed_outward_mesh(seed):
    solid = np.random.default_rng(seed).random((5, 6, 7)) < 0.5
    vertices, faces = mesh_surface(solid)
    edges = directed_edges(faces)
    assert all(edges[(b, a)] == n for (a, b), n in edges.items())
    assert volume(vertices, faces) == pytest.approx(solid.sum())


def test_what_is_seen_through_is_carved_and_the_rest_stays(step):
    solid, cell = visual_hull([step], BOX)
    heights = solid.sum(axis=2) * cell[2]
    quarter = solid.shape[0] // 4
    assert np.allclose(heights[quarter, 2:-2], 0.1)
    assert np.allclose(heights[-quarter, 2:-2], 0.05, atol=2.1 * cell.max())


def test_smoothing_keeps_the_mesh_closed_and_about_as_large(step):
    vertices, faces = build_mesh([step], BOX)
    solid, cell = visual_hull([step], BOX)
    edges = directed_edges(faces)
    assert all(edges[(b, a)] == n for (a, b), n in edges.items())
    assert volume(vertices, faces) == pytest.approx(solid.sum() * cell.prod(), rel=0.05)
    assert np.all(np.abs(vertices) <= BOX.extent.array + cell)


@pytest.mark.parametrize("depth", [1.2, np.nan, 0.0])
def test_views_of_nothing_make_no_mesh(look_down, depth):
    camera = look_down(np.full((240, 240), depth))
    with pytest.raises(PerceptionError, match="nothing"):
        build_mesh([MaskedView(camera, np.ones((240, 240), dtype=bool))], BOX)


def test_depth_without_a_mask_is_not_the_object(step):
    with pytest.raises(PerceptionError, match="nothing"):
        build_mesh([MaskedView(step.camera, np.zeros_like(step.mask))], BOX)
    assert isinstance(step.camera.depth, DepthImage)
