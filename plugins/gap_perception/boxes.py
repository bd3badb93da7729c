"""Which segments fill a box of an image, and what to cut out where none does."""

from __future__ import annotations

import math

import numpy as np

from gap_catalogue.checks import clipped
from gap_perception.candidates import Candidate
from gap_perception.image_view import view_image
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, BoundingBox2D, Image

FILLS = 0.3  # overlap (intersection over union of boxes) from which a segment is offered
PART = 0.6  # below this best overlap, the box means a part of something
HOLDS = 0.8  # share of the box's pixels inside one segment from which it is a part of that segment
PART_SCORE = 0.5  # colour alone says little about where a part ends
CUT_ROUNDS = 3
_MIN_BOX = 3  # px: smaller boxes hold nothing to cut
_MIN_CUT = 20  # px


def fill(ctx: ToolContext, image: Image, box: BoundingBox2D) -> list[tuple[float, Array]]:
    """(score, mask) of the segments that fill the box, best first. Raises `BadRequestError` for a box without area."""
    low_x, low_y, high_x, high_y = clipped(box, image)
    x0, y0, x1, y1 = math.floor(low_x), math.floor(low_y), math.ceil(high_x), math.ceil(high_y)
    view = view_image(ctx, image)
    scored = [(_overlap(c, (x0, y0, x1, y1)), c) for c in view.candidates]
    found = [(score, c.mask) for score, c in scored if score >= FILLS]
    found.sort(key=lambda f: -f[0])
    if found and found[0][0] >= PART:
        return found
    inside = [c for c in view.candidates if c.mask[y0:y1, x0:x1].mean() >= HOLDS]
    if inside:
        return [(PART_SCORE, _only_inside(inside[0].mask, (x0, y0, x1, y1))), *found]
    if found or view.has_depth:
        return found
    cut = _cut(image, (x0, y0, x1, y1))
    return [(PART_SCORE, cut)] if np.count_nonzero(cut) >= _MIN_CUT else []


def _overlap(candidate: Candidate, box: tuple[int, int, int, int]) -> float:
    """Intersection over union of the candidate's box and the given one."""
    a, b = candidate.box, box
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if wide <= 0 or high <= 0:
        return 0.0
    area = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1])
    return wide * high / (area - wide * high)


def _only_inside(mask: Array, box: tuple[int, int, int, int]) -> Array:
    x0, y0, x1, y1 = box
    part = np.zeros_like(mask)
    part[y0:y1, x0:x1] = mask[y0:y1, x0:x1]
    return part


def _cut(image: Image, box: tuple[int, int, int, int]) -> Array:
    """Foreground of a box by colour alone: GrabCut (Rother et al., 2004), seeded so that it always cuts the same."""
    import cv2

    x0, y0, x1, y1 = box
    rows, columns = image.data.shape[:2]
    mask = np.zeros((rows, columns), np.uint8)
    whole = x1 - x0 >= columns and y1 - y0 >= rows
    if min(x1 - x0, y1 - y0) < _MIN_BOX or whole or image.data.min() == image.data.max():
        return mask.astype(bool)
    cv2.setRNGSeed(0)
    back, front = np.zeros((1, 65)), np.zeros((1, 65))
    pixels = np.ascontiguousarray(image.data[..., ::-1])
    cv2.grabCut(pixels, mask, (x0, y0, x1 - x0, y1 - y0), back, front, CUT_ROUNDS, cv2.GC_INIT_WITH_RECT)
    return np.asarray((mask == cv2.GC_FGD) | (mask == cv2.GC_PR_FGD))
