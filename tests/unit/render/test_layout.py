"""Drawings: nothing overlaps, links run downwards, the same graph gives the same drawing."""

from __future__ import annotations

import itertools
import random

import pytest

from gap_cli.render.layout import GAP_X, lay_out


def random_graph(seed):
    rng = random.Random(seed)
    names = [f"n{i}" for i in range(rng.randint(2, 25))]
    sizes = {n: (rng.uniform(20, 160), rng.uniform(20, 60)) for n in names}
    links = [tuple(rng.sample(names, 2)) for _ in range(2 * len(names))]
    return sizes, links


def overlap(a, b):
    return a.x < b.x + b.width and b.x < a.x + a.width and a.y < b.y + b.height and b.y < a.y + a.height


@pytest.mark.parametrize("seed", range(20))
def test_no_two_boxes_overlap_and_all_are_inside(seed):
    sizes, links = random_graph(seed)
    drawn = lay_out(sizes, links)
    for a, b in itertools.combinations(drawn.boxes.values(), 2):
        assert not overlap(a, b)
    for name, box in drawn.boxes.items():
        assert (box.width, box.height) == sizes[name]
        assert box.x >= -1e-6 and box.x + box.width <= drawn.width + 1e-6
        assert box.y >= -1e-6 and box.y + box.height <= drawn.height + 1e-6


@pytest.mark.parametrize("seed", range(20))
def test_links_keep_clear_of_boxes_they_pass(seed):
    sizes, links = random_graph(seed)
    drawn = lay_out(sizes, links)
    for link, points in drawn.routes.items():
        for (x, y), (nx, ny) in itertools.pairwise(points):
            if x == nx:  # a straight run beside a layer
                for name, box in drawn.boxes.items():
                    inside = box.x < x < box.x + box.width and box.y < max(y, ny) and min(y, ny) < box.y + box.height
                    assert name in link or not inside


def test_every_link_runs_from_its_source_to_its_target():
    sizes, links = random_graph(3)
    drawn = lay_out(sizes, links)
    for (a, b), points in drawn.routes.items():
        ends = {points[0], points[-1]}
        assert ends == {drawn.boxes[a].bottom, drawn.boxes[b].top} or ends == {
            drawn.boxes[b].bottom,
            drawn.boxes[a].top,
        }
    assert set(drawn.routes) == {link for link in links if link[0] != link[1]}


def test_what_follows_stands_below():
    drawn = lay_out(dict.fromkeys("abc", (50.0, 20.0)), [("a", "b"), ("b", "c"), ("a", "c")])
    assert drawn.boxes["a"].y < drawn.boxes["b"].y < drawn.boxes["c"].y


def test_branches_stand_side_by_side_around_what_they_share():
    drawn = lay_out(dict.fromkeys("abcd", (50.0, 20.0)), [("a", "b"), ("a", "c"), ("b", "d"), ("c", "d")])
    b, c = drawn.boxes["b"], drawn.boxes["c"]
    assert abs(b.y - c.y) < 1e-6 and c.x - b.x >= 50 + GAP_X - 1e-6
    middle = (b.x + c.x + c.width) / 2
    assert all(abs(drawn.boxes[n].x + 25 - middle) < 1e-3 for n in "ad")


def test_a_loop_is_drawn_and_the_drawing_is_a_function_of_the_graph():
    sizes, links = dict.fromkeys("ab", (50.0, 20.0)), [("a", "b"), ("b", "a")]
    assert lay_out(sizes, links) == lay_out(sizes, links)
    assert len(lay_out(sizes, links).routes) == 2


def test_nothing_is_drawn_as_nothing():
    assert lay_out({}, []).boxes == {}
