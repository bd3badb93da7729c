"""Colours as comparable under changing light."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.types import Array


def perceptual(rgb: Array) -> Array:
    """CIE L*a*b* of an RGB image (..., 3) uint8, as float32: L 0 to 100, a and b about -100 to 100."""
    import cv2

    image = np.ascontiguousarray(rgb.reshape(1, -1, 3) if rgb.ndim == 2 else rgb)
    lab = cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    return np.asarray(lab.reshape(rgb.shape))
