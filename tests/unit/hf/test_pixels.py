"""Pixels and prompts into a network's square and back: nothing moves on the way."""

from __future__ import annotations

import numpy as np
import pytest

from gap_catalogue.checks import clipped
from gap_hf.vision.pixels import HALVES, IMAGENET, Square, bounds, check_image, to_array, to_boxes, to_image
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image
from tests.unit.hf import tiny

BOX = (20, 10, 60, 30)
IMAGE = Image(tiny.picture(48, 80, BOX))


def test_normalising_is_undone_by_its_own_numbers():
    square = Square(64, *IMAGENET)
    x = to_array(square.pixels(Image(np.full((30, 50, 3), 128, np.uint8)), "cpu"))
    back = x[0].transpose(1, 2, 0) * IMAGENET[1] + IMAGENET[0]
    assert x.shape == (1, 3, 64, 64)
    assert np.allclose(back * 255, 128, atol=1e-3)


def test_channels_stay_red_green_blue():
    red = np.zeros((8, 8, 3), np.uint8)
    red[..., 0] = 255
    x = to_array(Square(8, *HALVES).pixels(Image(red), "cpu"))[0]
    assert (x[0] == 1).all() and (x[1:] == -1).all()


@pytest.mark.parametrize("side", [40, 64, 112, 300])
def test_a_bright_box_comes_back_where_it_was(side):
    x = Square(side, *HALVES).pixels(IMAGE, "cpu")
    mask = to_array(to_image(x.mean(dim=1), IMAGE)[0] > 0)
    found = bounds(mask)
    pixel = max(48, 80) / side  # of the square, in pixels of the image
    assert np.allclose([found.x_min, found.y_min, found.x_max, found.y_max], BOX, atol=1 + pixel / 2)
    assert mask[10:30, 20:60].mean() > 0.9


def test_points_scale_with_each_side():
    xy = to_array(Square(100, *HALVES).points([(0, 0), (80, 48), (40, 12)], IMAGE, "cpu"))
    assert np.allclose(xy, [(0, 0), (100, 100), (50, 25)])


def test_boxes_are_cut_at_the_border():
    import torch

    (box,) = to_boxes(torch.tensor([[-5.0, 3.0, 90.0, 60.0]]), IMAGE)
    assert box == BoundingBox2D(0.0, 3.0, 80.0, 48.0)


def test_the_bounds_of_a_mask_are_exclusive():
    mask = np.zeros((6, 8), bool)
    assert bounds(mask) == BoundingBox2D(0, 0, 0, 0)
    mask[2:4, 3:7] = True
    assert bounds(mask) == BoundingBox2D(3, 2, 7, 4)


@pytest.mark.parametrize(
    ("box", "code"),
    [((5, 5, 5, 9), "box"), ((9, 5, 5, 9), "box"), ((90, 5, 99, 9), "outside"), ((np.nan, 0, 5, 5), "box")],
)
def test_boxes_without_area_inside_are_refused(box, code):
    with pytest.raises(BadRequestError) as caught:
        clipped(BoundingBox2D(*box), IMAGE)
    assert caught.value.code == code


def test_an_image_without_pixels_is_refused():
    with pytest.raises(BadRequestError, match="no pixels"):
        check_image(Image(np.zeros((0, 5, 3), np.uint8)))
