"""Picks the pixel of a mask that is safest to touch or point at."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.types import Array


def deepest_pixel(mask: Array) -> tuple[int, int]:
    """(x, y) of the pixel of a non-empty mask (H, W) that is farthest from its outline."""
    import cv2

    padded = np.pad(mask.astype(np.uint8), 1)
    depth = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1]
    y, x = np.unravel_index(int(depth.argmax()), depth.shape)
    return int(x), int(y)
