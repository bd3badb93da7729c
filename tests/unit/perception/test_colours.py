import numpy as np
import pytest

from gap_perception.scene.colours import colour_words, hue_histogram, overlap, perceptual


@pytest.mark.parametrize(
    ("rgb", "word"),
    [
        ((200, 30, 40), "red"), ((255, 140, 0), "orange"), ((250, 220, 40), "yellow"), ((30, 130, 50), "green"),
        ((30, 90, 200), "blue"), ((250, 250, 250), "white"), ((15, 15, 15), "black"), ((95, 50, 25), "brown"),
        ((120, 120, 122), "grey"),
    ],
)  # fmt: skip
def test_plain_colours_have_their_names(rgb, word):
    assert word in colour_words(perceptual(np.tile(np.array(rgb, np.uint8), (50, 1))))


def test_a_histogram_overlaps_itself_and_not_the_opposite():
    red, green = (hue_histogram(np.tile([50.0, a, 0.0], (30, 1))) for a in (60.0, -60.0))
    assert overlap(red, red) == pytest.approx(1) and overlap(red, green) < 0.01


def test_no_pixels_have_no_colours():
    assert perceptual(np.zeros((0, 3), np.uint8)).shape == (0, 3)
