"""Colours as comparable under changing light."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.types import Array


def perceptual(rgb: Array) -> Array:
    """CIE L*a*b* of an RGB image (..., 3) uint8, as float32: L 0 to 100, a and b about -100 to 100."""
    import cv2

    if not rgb.size:
        return np.zeros(rgb.shape, dtype=np.float32)
    image = np.ascontiguousarray(rgb.reshape(1, -1, 3) if rgb.ndim == 2 else rgb)
    lab = cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    return np.asarray(lab.reshape(rgb.shape))


GREYISH = 14.0  # CIELAB chroma below which a surface has no hue
SHOWN = 0.12  # share of the surface from which a colour is one somebody might name
HUES = (  # CIELAB hue angle up to which the name holds [deg]
    (48.0, "red"), (77.0, "orange"), (108.0, "yellow"), (195.0, "green"), (310.0, "blue"), (345.0, "purple"),
    (360.0, "red"),
)  # fmt: skip


def colour_words(lab: Array) -> frozenset[str]:
    """The colour words that may describe a surface of CIELAB colours (N, 3), seen under this world's light."""
    lightness, chroma = lab[:, 0], np.hypot(lab[:, 1], lab[:, 2])
    hue = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360
    plain, bright = chroma < GREYISH, np.quantile(lightness, 0.95)
    # Dark orange is what people call brown; pale red, pink. Whites are judged against the brightest the object shows.
    brown = ~plain & (hue > 25) & (hue < 85) & (((lightness < 38) & (chroma < 42)) | ((chroma < 30) & (lightness < 60)))
    shares = {
        "black": plain & (lightness < 25),
        "grey": plain & (lightness >= 25) & (lightness < 80),
        "white": plain & (lightness > 55) & (lightness > 0.75 * bright),
        "brown": brown,
        "pink": ~plain & ((hue < 25) | (hue > 345)) & (lightness > 60),
        "beige": ~plain & (hue > 60) & (hue < 100) & (lightness > 60) & (chroma < 40),
    }
    low = 0.0
    for high, name in HUES:
        shares[name] = shares.get(name, False) | (~plain & ~brown & (hue >= low) & (hue < high))
        low = high
    found = {name for name, where in shares.items() if np.mean(where) >= SHOWN}
    return frozenset(found | ({"gray", "silver"} if "grey" in found else set()))


BINS, LIMITS = 14, ((-70.0, 90.0), (-70.0, 90.0))


def hue_histogram(lab: Array) -> Array:
    """Smoothed share of each hue and saturation among CIELAB colours (N, 3); sums to 1."""
    import cv2

    counts, _, _ = np.histogram2d(lab[:, 1], lab[:, 2], bins=BINS, range=LIMITS)
    smooth = cv2.GaussianBlur(counts, (3, 3), 0.8, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(smooth / max(smooth.sum(), 1e-9))


def overlap(a: Array, b: Array) -> float:
    """Bhattacharyya coefficient of two histograms: 1 for equal, 0 for nothing in common."""
    return float(np.sqrt(a * b).sum())
