"""Draws printed packaging: a wrap-around label and a lid, as RGB images, the same bytes every time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from gap_runtime.contracts.task import Appearance, rgb
from gap_runtime.contracts.types import Array

PIXELS_PER_METRE = 4000
_FONT = cv2.FONT_HERSHEY_DUPLEX
_MIN_SIDE = 16


def draw_side(looks: Appearance, faces: Sequence[float], height: float) -> Array:
    """The label around an object: one panel per face, `faces` their widths [m]. RGB uint8, shape (H, W, 3)."""
    rows = _pixels(height)
    panels = [_panel(looks, rows, _pixels(width)) for width in faces]
    return np.ascontiguousarray(np.hstack(panels))


def draw_top(looks: Appearance, size: tuple[float, float]) -> Array:
    """The face seen from above, `size` along x and y [m]. RGB uint8, shape (H, W, 3)."""
    cols, rows = _pixels(size[0]), _pixels(size[1])
    if looks.style == "can":
        return _lid(looks, rows, cols)
    if looks.style == "box":
        return _panel(looks, rows, cols)
    return np.full((rows, cols, 3), rgb(looks.cap if looks.style == "bottle" else looks.base), np.uint8)


def draw_weave(looks: Appearance, size: int = 256) -> Array:
    """A wicker weave for baskets. RGB uint8, shape (size, size, 3)."""
    image = np.full((size, size, 3), rgb(looks.base), np.uint8)
    step = size // 16
    for row in range(0, size, step):
        for col in range(0, size, step):
            if (row // step + col // step) % 2:
                image[row + 1 : row + step - 1, col : col + step] = rgb(looks.accent)
    for line in range(0, size, step):
        image[line : line + 2] = (np.array(rgb(looks.base)) * 0.55).astype(np.uint8)
    return image


def _pixels(metres: float) -> int:
    return max(_MIN_SIDE, round(metres * PIXELS_PER_METRE))


def _panel(looks: Appearance, rows: int, cols: int) -> Array:
    image = np.full((rows, cols, 3), rgb(looks.base), np.uint8)
    _PATTERNS.get(looks.pattern, _no_pattern)(image, rgb(looks.accent))
    if looks.text:
        top, bottom = (round(rows * f) for f in ((0.16, 0.84) if looks.style == "box" else (0.30, 0.66)))
        inset = round(cols * 0.06) if looks.style == "box" else 0
        cv2.rectangle(image, (inset, top), (cols - 1 - inset, bottom), rgb(looks.accent), cv2.FILLED)
        edge = max(1, rows // 90)
        for y in (top + 2 * edge, bottom - 2 * edge):
            cv2.line(image, (inset, y), (cols - 1 - inset, y), rgb(looks.ink), edge, cv2.LINE_AA)
        _print(image, looks.text, (inset + 2, top + 4 * edge, cols - 2 - inset, bottom - 4 * edge), rgb(looks.ink))
    return image


def _print(image: Array, lines: Sequence[str], area: tuple[int, int, int, int], ink: tuple[int, int, int]) -> None:
    """Centre the lines in the area (left, top, right, bottom), as large as they fit."""
    left, top, right, bottom = area
    line_height = (bottom - top) / len(lines)
    sizes = [cv2.getTextSize(line, _FONT, 1.0, 2)[0] for line in lines]
    scale = min(0.9 * (right - left) / max(w for w, _ in sizes), 0.66 * line_height / max(h for _, h in sizes))
    thickness = max(1, round(2.2 * scale))
    for i, (line, (width, height)) in enumerate(zip(lines, sizes, strict=True)):
        x = round((left + right - scale * width) / 2)
        y = round(top + (i + 0.5) * line_height + scale * height / 2)
        cv2.putText(image, line, (x, y), _FONT, scale, ink, thickness, cv2.LINE_AA)


def _lid(looks: Appearance, rows: int, cols: int) -> Array:
    """A tin's lid: concentric pressed rings and a pull tab."""
    metal = np.array(rgb(looks.cap))
    image = np.full((rows, cols, 3), metal, np.uint8)
    centre, radius = (cols // 2, rows // 2), min(rows, cols) // 2
    for share, shade in ((0.94, 0.72), (0.86, 0.94), (0.62, 0.8), (0.58, 1.0)):
        cv2.circle(image, centre, round(radius * share), _shade(metal, shade), cv2.FILLED, cv2.LINE_AA)
    cv2.ellipse(image, centre, (radius // 5, radius // 3), 0, 0, 360, _shade(metal, 0.6), radius // 12, cv2.LINE_AA)
    return image


def _shade(colour: Array, factor: float) -> tuple[int, int, int]:
    r, g, b = np.clip(colour * factor, 0, 255).astype(int)
    return int(r), int(g), int(b)


def _no_pattern(image: Array, ink: tuple[int, int, int]) -> None:
    pass


def _letters(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    step = max(10, rows // 7)
    for i, y in enumerate(range(step, rows, step)):
        for j, x in enumerate(range(0, cols, step)):
            letter = chr(ord("A") + (5 * i + 3 * j) % 26)
            cv2.putText(image, letter, (x + 2, y), _FONT, step / 34, ink, max(1, step // 20), cv2.LINE_AA)


def _disc(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    for y in (0.15, 0.83):
        radius = round(min(rows * 0.12, cols * 0.4))
        cv2.circle(image, (cols // 2, round(rows * y)), radius, ink, cv2.FILLED, cv2.LINE_AA)


def _stripes(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    step = max(8, cols // 6)
    for x in range(-rows, cols, step):
        cv2.line(image, (x, rows), (x + rows, 0), ink, max(2, step // 3), cv2.LINE_AA)


def _dots(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    step = max(10, cols // 5)
    for i, y in enumerate(range(step // 2, rows, step)):
        for x in range(step // 2 if i % 2 else 0, cols + step, step):
            cv2.circle(image, (x, y), step // 4, ink, cv2.FILLED, cv2.LINE_AA)


def _waves(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    x = np.arange(cols)
    crest = np.sin(2 * np.pi * x / max(cols, 1)) * rows * 0.03
    for level in (0.12, 0.22, 0.76, 0.86):
        points = np.stack([x, rows * level + crest], axis=1).round().astype(np.int32)
        cv2.polylines(image, [points], False, ink, max(2, rows // 28), cv2.LINE_AA)


def _chevrons(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    step = max(10, rows // 9)
    for y in range(0, rows + step, step):
        points = np.array([[0, y], [cols // 2, y - step], [cols, y]], np.int32)
        cv2.polylines(image, [points], False, ink, max(2, step // 4), cv2.LINE_AA)


def _checks(image: Array, ink: tuple[int, int, int]) -> None:
    rows, cols = image.shape[:2]
    step = max(6, min(rows, cols) // 6)
    y, x = np.mgrid[:rows, :cols]
    image[(y // step + x // step) % 2 == 1] = ink


_PATTERNS: dict[str, Callable[[Array, tuple[int, int, int]], None]] = {
    "letters": _letters, "disc": _disc, "stripes": _stripes, "dots": _dots, "waves": _waves, "chevrons": _chevrons,
    "checks": _checks,
}  # fmt: skip
