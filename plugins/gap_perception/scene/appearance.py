"""Looks at an image without depth: what stands out from the background, judged by its colours alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gap_perception.candidates import Candidate, box_of
from gap_perception.scene.colours import hue_histogram, overlap, perceptual
from gap_perception.scene.library import SurfaceModel
from gap_runtime.contracts.types import Array, Image

WORKING_SIDE = 640  # px: larger images are looked at reduced to this
BORDER_COLOURS = 4  # clusters of colour along the border that may be background
BORDER_SHARE = 0.08  # of the border from which a cluster is background
BACKGROUND = 9.0  # CIELAB distance within which a pixel looks like the background
SMALLEST, LARGEST = 0.0006, 0.5  # share of the image an object may cover
MOST = 0.6  # no colour alone makes surer than this
SHARPNESS = 14.0  # log-likelihood per unit of histogram overlap; calibrated on development scenes
UNKNOWN_OVERLAP = 0.62  # histogram overlap at which something unknown is as likely


def segment_by_appearance(image: Image, library: Mapping[str, SurfaceModel]) -> list[Candidate]:
    """The parts of an image that stand out, each with the probability of being each model; largest first."""
    import cv2

    rows, columns = image.data.shape[:2]
    scale = min(1.0, WORKING_SIDE / max(rows, columns))
    size = (max(1, round(columns * scale)), max(1, round(rows * scale)))
    small = cv2.resize(image.data, size, interpolation=cv2.INTER_AREA) if scale < 1 else image.data
    lab = perceptual(small)
    labels = _foreground(lab)
    histograms = {name: surface.hues for name, surface in library.items()}
    found = []
    for label in range(1, int(labels.max()) + 1):
        part = labels == label
        scores = _appearance_scores(hue_histogram(lab[part]), histograms)
        mask = part if scale == 1 else _enlarged(part, (columns, rows))
        found.append(Candidate(mask, box_of(mask), scores))
    return sorted(found, key=lambda c: (-np.count_nonzero(c.mask), c.box))


def _foreground(lab: Array) -> Array:
    """Label image: 0 where the colour is one of the border's, else the number of a connected part, shape (H, W)."""
    import cv2

    border = np.concatenate([lab[0], lab[-1], lab[:, 0], lab[:, -1]]).astype(np.float32)
    cv2.setRNGSeed(0)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 20, 0.5)
    k = min(BORDER_COLOURS, len(np.unique(border, axis=0)))
    _, members, centres = cv2.kmeans(border, k, None, stop, 1, cv2.KMEANS_PP_CENTERS)
    share = np.bincount(members.ravel(), minlength=k) / len(border)
    background = np.zeros(lab.shape[:2], dtype=bool)
    for centre in centres[share >= BORDER_SHARE]:
        background |= (((lab - centre) ** 2) @ np.array([0.35, 1.0, 1.0])) < BACKGROUND**2
    kernel = np.ones((3, 3), np.uint8)
    clean = cv2.morphologyEx((~background).astype(np.uint8), cv2.MORPH_OPEN, kernel)
    clean = cv2.morphologyEx(clean, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(clean, connectivity=4)
    area = stats[:, cv2.CC_STAT_AREA] / labels.size
    keep = (area >= SMALLEST) & (area <= LARGEST)
    keep[0] = False
    return np.asarray((np.cumsum(keep) * keep)[labels])


def _appearance_scores(seen: Array, histograms: Mapping[str, Array]) -> dict[str, float]:
    """Posterior over models and "none of them" from the Bhattacharyya overlap of colours."""
    shared = {name: overlap(seen, histogram) for name, histogram in histograms.items()}
    weight = {name: np.exp(SHARPNESS * (value - UNKNOWN_OVERLAP)) for name, value in shared.items()}
    total = 1.0 + sum(weight.values())
    return {name: float(MOST * value / total) for name, value in weight.items()}


def _enlarged(part: Array, size: tuple[int, int]) -> Array:
    import cv2

    return np.asarray(cv2.resize(part.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST).astype(bool))
