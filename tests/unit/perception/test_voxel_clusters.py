import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gap_perception.scene.voxel_clusters import LINK, VOXEL, NeighbourGraph, voxelise


@given(st.integers(0, 2**32 - 1), st.integers(0, 200))
def test_voxels_keep_every_point_within_a_cell_of_their_centre(seed, count):
    points = np.random.default_rng(seed).uniform(-0.1, 0.1, (count, 3))
    voxels = voxelise(points)
    assert voxels.counts.sum() == count
    assert np.all(np.abs(voxels.centers[voxels.of_point] - points) <= VOXEL)


def test_a_chain_of_near_points_is_one_group_and_a_gap_makes_two():
    x = np.r_[np.arange(0, 0.05, 0.9 * LINK), np.arange(0.2, 0.23, 0.9 * LINK)]
    graph = NeighbourGraph(np.column_stack([x, 0 * x, 0 * x]))
    first, second = graph.clusters(np.arange(len(x)))
    assert len(first) > len(second) and set(first) | set(second) == set(range(len(x)))
    assert x[first].max() < 0.1 < x[second].min()


def test_a_subset_is_grouped_without_the_points_left_out():
    x = np.arange(5) * 0.9 * LINK
    graph = NeighbourGraph(np.column_stack([x, 0 * x, 0 * x]))
    assert [list(g) for g in graph.clusters(np.array([0, 1, 3, 4]))] == [[0, 1], [3, 4]]


def test_no_points_make_no_groups():
    assert NeighbourGraph(np.zeros((0, 3))).clusters(np.zeros(0, dtype=int)) == []
    assert len(voxelise(np.zeros((0, 3))).centers) == 0
