import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gap_perception.outlines import outline_gap

SQUARE = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=float)


@given(st.floats(2.1, 10))
def test_squares_apart_along_an_axis_are_apart_by_the_rest(x):
    assert np.isclose(outline_gap(SQUARE, SQUARE + np.array([x, 0])), x - 2)


@given(st.floats(2.1, 10), st.floats(2.1, 10))
def test_squares_apart_across_corners_are_apart_by_the_corners(x, y):
    assert np.isclose(outline_gap(SQUARE, SQUARE + np.array([x, y])), np.hypot(x - 2, y - 2))


@given(st.floats(0, 1.9), st.floats(0, 1.9))
def test_overlap_is_negative(x, y):
    assert outline_gap(SQUARE, SQUARE + np.array([x, y])) < 0
