"""Noise of depth and colour is what was declared, and no more."""

from __future__ import annotations

import numpy as np
import pytest

from gap_mujoco.rendering.stereo import grainy, hidden_from_second, measured_depth, noisy_colour
from gap_runtime.contracts.task.sensors import StereoDepth

SHAPE = (240, 320)
WALL = np.full(SHAPE, 1.5, np.float32)
FOCAL = 300.0


def stereo(**more):
    return StereoDepth(baseline=0.05, focal=400.0, subpixel=0.1, **more)


def measure(depth, noise, seed=0):
    return measured_depth(depth, FOCAL, noise, np.random.default_rng(seed))


@pytest.mark.parametrize("grain", [0.0, 1.0, 2.5])
def test_depth_deviates_as_declared(grain):
    found = measure(WALL, stereo(grain=grain))
    assert found.dtype == np.float32
    assert found.std() == pytest.approx(stereo().deviation(1.5), rel=0.1)
    assert found.mean() == pytest.approx(1.5, abs=0.002)


def test_no_disparity_noise_leaves_a_wall_as_it_is():
    assert np.allclose(measure(WALL, StereoDepth(baseline=0.05, focal=400, subpixel=0, jitter=2)), WALL)


@pytest.mark.parametrize("share", [0.01, 0.2])
def test_as_many_pixels_drop_out_as_declared(share):
    missing = measure(WALL, stereo(dropout=share, grain=1.0)) == 0
    assert missing.mean() == pytest.approx(share, rel=0.25)
    # In specks: a missing pixel's neighbour is far likelier to be missing than any pixel.
    assert missing[:, 1:][missing[:, :-1]].mean() > 3 * share or share > 0.1


def test_depth_comes_in_units():
    found = measure(WALL, stereo(unit=0.001)).astype(float)
    assert np.allclose(found, np.rint(found * 1000) / 1000, atol=1e-6)


def test_what_has_no_depth_gets_none():
    hole = WALL.copy()
    hole[50:90, 50:90] = 0
    assert (measure(hole, stereo())[50:90, 50:90] == 0).all()


def test_the_second_imager_misses_a_strip_left_of_what_is_near():
    near, far = 1.0, 1.6
    depth = np.full(SHAPE, far)
    depth[:, 100:200] = near
    strip = FOCAL * 0.05 * (1 / near - 1 / far)
    hidden = hidden_from_second(depth, FOCAL * 0.05)
    assert hidden.any(axis=0).nonzero()[0].max() == 99
    assert hidden[0].sum() == pytest.approx(strip, abs=1)
    assert not hidden_from_second(WALL, FOCAL * 0.05).any()


def test_jitter_frays_edges_only():
    depth = WALL.copy()
    depth[:, 160:] = 1.0
    found = measure(depth, StereoDepth(baseline=1e-6, focal=400, subpixel=0, jitter=1))
    moved = np.flatnonzero((found != depth).any(axis=0))
    assert 2 <= len(moved) <= 12 and abs(moved - 159.5).max() < 6


def test_grain_makes_neighbours_alike_and_keeps_the_variance():
    rng = np.random.default_rng(0)
    for sigma, alike in ((0.0, 0.0), (1.0, np.exp(-1 / 4)), (2.0, np.exp(-1 / 16))):
        field = grainy(SHAPE, sigma, rng)
        assert field.shape == SHAPE and field.std() == pytest.approx(1, rel=0.05)
        assert np.corrcoef(field[:, 1:].ravel(), field[:, :-1].ravel())[0, 1] == pytest.approx(alike, abs=0.05)
        assert field[:5].std() == pytest.approx(1, rel=0.2)


def test_colour_deviates_as_declared():
    grey = np.full((*SHAPE, 3), 128, np.uint8)
    found = noisy_colour(grey, 5.0, np.random.default_rng(0)).astype(float)
    assert found.std() == pytest.approx(5.0, rel=0.05) and found.mean() == pytest.approx(128, abs=0.1)
    assert abs(np.corrcoef(found[..., 0].ravel(), found[..., 1].ravel())[0, 1]) < 0.02


def test_extreme_noise_gives_unknown_depth_not_nonsense():
    wild = StereoDepth(baseline=0.001, focal=1, subpixel=10)
    found = measure(WALL, wild)
    assert np.isfinite(found).all() and (found >= 0).all() and (found == 0).any()
