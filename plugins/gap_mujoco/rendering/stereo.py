"""What an active stereo camera makes of a perfect depth image, and an image sensor of a perfect picture."""

from __future__ import annotations

import math

import cv2
import numpy as np
from scipy.stats import norm

from gap_runtime.contracts.task.sensors import StereoDepth
from gap_runtime.contracts.types import Array


def measured_depth(depth: Array, focal: float, noise: StereoDepth, rng: np.random.Generator) -> Array:
    """Depth (H, W) [m] as measured, float32, 0 where unknown; `focal` [px] is the picture's.

    The picture is taken to be the first imager's; the second is `noise.baseline` to its right. Not modelled: a bias of
    depth (calibrated away), surfaces that shine or let light through, and other cameras' projectors.
    """
    lost = (depth <= 0) | hidden_from_second(depth, focal * noise.baseline)
    z = _jittered(depth, noise.jitter, rng)
    error = noise.subpixel * grainy(z.shape, noise.grain, rng)
    stretch = 1 + error * z / (noise.focal * noise.baseline)  # z = f b / d, with the disparity d off by `error`
    lost |= (z <= 0) | (stretch <= 0)
    if noise.dropout > 0:
        lost |= grainy(z.shape, noise.grain, rng) < norm.ppf(noise.dropout)
    measured = z / np.where(lost, 1, stretch)
    if noise.unit > 0:
        measured = np.rint(measured / noise.unit) * noise.unit
    return np.where(lost, 0, measured).astype(np.float32)


def hidden_from_second(depth: Array, focal_baseline: float) -> Array:
    """Pixels (H, W) that something nearer covers in the second imager's picture; `focal_baseline` [px m]."""
    disparity = np.where(depth > 0, focal_baseline / np.where(depth > 0, depth, 1), 0)
    second = np.arange(depth.shape[1]) - disparity  # column in the second picture
    beyond = np.minimum.accumulate(second[:, ::-1], axis=1)[:, ::-1]
    hidden = np.zeros(depth.shape, dtype=bool)
    hidden[:, :-1] = beyond[:, 1:] < second[:, :-1]
    return hidden


def noisy_colour(rgb: Array, deviation: float, rng: np.random.Generator) -> Array:
    """The picture (H, W, 3) uint8 with Gaussian noise in every channel; `deviation` in levels."""
    noise = rng.standard_normal(rgb.shape, dtype=np.float32) * np.float32(deviation)
    return np.asarray(np.clip(np.rint(rgb + noise), 0, 255), dtype=np.uint8)


def grainy(shape: tuple[int, int], grain: float, rng: np.random.Generator) -> Array:
    """Standard normal values, smoothed by a Gaussian of `grain` [px] without losing their variance, float32."""
    side = math.ceil(3 * grain)
    white = rng.standard_normal((shape[0] + 2 * side, shape[1] + 2 * side), dtype=np.float32)
    if not side:
        return white
    kernel = cv2.getGaussianKernel(2 * side + 1, grain, cv2.CV_32F)
    smooth = cv2.sepFilter2D(white, -1, kernel, kernel)[side:-side, side:-side]
    return np.asarray(smooth / (kernel**2).sum())


def _jittered(depth: Array, jitter: float, rng: np.random.Generator) -> Array:
    """Depth (H, W) with every pixel taken from near where it belongs."""
    if jitter == 0:
        return depth
    moved = np.rint(rng.standard_normal((2, *depth.shape), dtype=np.float32) * np.float32(jitter)).astype(np.int64)
    rows = np.clip(np.arange(depth.shape[0])[:, None] + moved[0], 0, depth.shape[0] - 1)
    columns = np.clip(np.arange(depth.shape[1]) + moved[1], 0, depth.shape[1] - 1)
    return np.asarray(depth[rows, columns])
