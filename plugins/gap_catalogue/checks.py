"""What several contracts refuse: checks of images, pixels, boxes, texts and numbers. All raise `BadRequestError`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image

MAX_PHRASES = 64
MAX_PROMPT = 8000  # characters


def phrases_of(texts: Iterable[str]) -> list[str]:
    """The different phrases among texts, stripped. Refuses none (`empty`) and more than `MAX_PHRASES` (`too_many`)."""
    phrases = list(dict.fromkeys(text.strip() for text in texts if text.strip()))
    if not 0 < len(phrases) <= MAX_PHRASES:
        raise BadRequestError(
            "empty" if not phrases else "too_many",
            f"The prompt holds {len(phrases)} phrases; 1 to {MAX_PHRASES} can be looked for.",
            hint='Write what to find, phrases ended by periods: "alphabet soup. basket."',
        )
    return phrases


def check_prompt(prompt: str) -> None:
    """Refuses an empty prompt and one beyond `MAX_PROMPT` characters (`prompt`)."""
    if not prompt.strip() or len(prompt) > MAX_PROMPT:
        raise BadRequestError("prompt", f"The prompt has {len(prompt)} characters; 1 to {MAX_PROMPT} are read.")


def check_fractions(**values: float) -> None:
    """Refuses what lies outside 0 to 1 (`range`)."""
    for name, value in values.items():
        if not 0 <= value <= 1:
            raise BadRequestError("range", f"{name} is {value}; it must lie between 0 and 1.")


def check_finite(**values: float) -> None:
    """Refuses what is not a finite number (`not_finite`)."""
    for name, value in values.items():
        if not np.isfinite(value):
            raise BadRequestError("not_finite", f"{name} is {value}; it must be a finite number.")


def check_counts(**values: int) -> None:
    """Refuses what is below 1 (`range`)."""
    for name, value in values.items():
        if value < 1:
            raise BadRequestError("range", f"{name} is {value}; it must be at least 1.")


def check_pixel(image: Image, x: int, y: int) -> None:
    """Refuses a pixel outside the image (`outside`)."""
    rows, columns = image.data.shape[:2]
    if not (0 <= x < columns and 0 <= y < rows):
        raise BadRequestError("outside", f"Pixel ({x}, {y}) is outside the {columns}x{rows} image.")


def clipped(box: BoundingBox2D, image: Image) -> tuple[float, float, float, float]:
    """The part of a box inside the image, x_min, y_min, x_max, y_max [px]. Refuses no area (`box`), none `outside`."""
    rows, columns = image.data.shape[:2]
    corners = np.array([box.x_min, box.y_min, box.x_max, box.y_max])
    if not np.isfinite(corners).all() or box.x_max <= box.x_min or box.y_max <= box.y_min:
        raise BadRequestError("box", f"The box {corners.tolist()} has no area (x_min, y_min, x_max, y_max).")
    x0, y0, x1, y1 = np.clip(corners, 0, (columns, rows, columns, rows))
    if x1 <= x0 or y1 <= y0:
        raise BadRequestError("outside", f"The box {corners.tolist()} lies outside the {columns}x{rows} image.")
    return float(x0), float(y0), float(x1), float(y1)
