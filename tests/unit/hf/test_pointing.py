"""Points as Molmo writes them."""

from __future__ import annotations

import pytest

from gap_hf.language.parsing import pixel, points


@pytest.mark.parametrize(
    ("answer", "want"),
    [
        ('<points coords="1 1 512 334">mug</points>', [(0.512, 0.334)]),
        ('<points coords="1 1 000 500 2 075 812">cats</points>', [(0.0, 0.5), (0.075, 0.812)]),
        ('<points coords="1 1 1000 000">corner</points>', [(1.0, 0.0)]),
        (
            'Counting the <points coords="1 1 100 200 2 300 400">cans</points> shows a total of 2.',
            [(0.1, 0.2), (0.3, 0.4)],
        ),
        ('<point x="51.2" y="33.4" alt="mug">mug</point>', [(0.512, 0.334)]),
        ('<points x1="10" y1="20.5" x2="90" y2="80" alt="x">x</points>', [(0.1, 0.205), (0.9, 0.8)]),
        ('<point x="120" y="33.4">beyond</point>', []),
        ("There are none.", []),
        ("", []),
    ],
)
def test_points_are_fractions_of_the_image(answer, want):
    assert points(answer) == [pytest.approx(p) for p in want]


def test_a_point_on_the_far_edge_is_the_last_pixel():
    assert pixel((1.0, 1.0), 640, 480) == (639, 479)
    assert pixel((0.0, 0.0), 640, 480) == (0, 0)
    assert pixel((0.5, 0.25), 640, 480) == (320, 120)
