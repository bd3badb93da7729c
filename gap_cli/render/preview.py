"""Values as small JSON for people: numbers in short, arrays by shape, images as thumbnails."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from gap_runtime.contracts.types import Array, DepthImage, Image, Mask

MAX_ITEMS, MAX_DEPTH, MAX_TEXT = 8, 4, 400
THUMBNAIL_PX = 168


def preview(value: Any, *, pictures: bool = True, depth: int = 0) -> Any:
    """JSON-able: scalars as they are, `{"type": ..., "fields" | "items" | "text" | "image": ...}` for the rest."""
    if value is None or isinstance(value, (bool, int, float, str, np.number)):
        return _scalar(value)
    if isinstance(value, (Image, Mask, DepthImage)):
        shape = "x".join(map(str, value.data.shape))
        return {"type": type(value).__name__, "text": shape} | ({"image": thumbnail(value)} if pictures else {})
    if isinstance(value, np.ndarray):
        return _array(value)
    if depth >= MAX_DEPTH:
        return {"type": type(value).__name__, "text": "..."}
    named = _named(value)
    if named is not None:
        shown = {
            str(k): preview(v, pictures=pictures, depth=depth + 1)
            for k, v in list(named.items())[: 4 * MAX_ITEMS]
            if v is not None
        }
        return {"type": type(value).__name__, "fields": shown}
    if isinstance(value, (list, tuple)):
        items = [preview(v, pictures=pictures, depth=depth + 1) for v in value[:MAX_ITEMS]]
        more = f"{len(value)} items" if len(value) > MAX_ITEMS else ""
        return {"type": "list", "items": items, "text": more}
    if isinstance(value, BaseException):
        return str(value) or type(value).__name__
    return {"type": type(value).__name__, "text": repr(value)[:MAX_TEXT]}


def thumbnail(value: Image | Mask | DepthImage) -> str:
    """A data URI of a small JPEG."""
    import cv2

    pixels = _pixels(value)
    scale = THUMBNAIL_PX / max(pixels.shape[:2])
    if scale < 1:
        size = (max(1, round(pixels.shape[1] * scale)), max(1, round(pixels.shape[0] * scale)))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(pixels), [cv2.IMWRITE_JPEG_QUALITY, 70])
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def _pixels(value: Image | Mask | DepthImage) -> Array:
    """BGR or grey, uint8."""
    if isinstance(value, Image):
        return np.asarray(value.data[:, :, ::-1])
    if isinstance(value, Mask):
        return value.data.astype(np.uint8) * 255
    depth = np.where(np.isfinite(value.data), value.data, 0.0)
    known = depth[depth > 0]
    if known.size == 0:
        return np.zeros(depth.shape, np.uint8)
    near, far = np.percentile(known, [1, 99])
    shade = 255 * (1 - (depth - near) / max(far - near, 1e-6))
    return np.asarray(np.where(depth > 0, np.clip(shade, 0, 255), 0).astype(np.uint8))


def _scalar(value: Any) -> Any:
    if isinstance(value, str):
        return value if len(value) <= MAX_TEXT else value[:MAX_TEXT] + "..."
    if isinstance(value, (float, np.floating)):
        number = float(value)
        return float(f"{number:.5g}") if np.isfinite(number) else str(number)
    return value.item() if isinstance(value, np.generic) else value


def _array(value: Array) -> dict[str, Any]:
    text = f"{value.dtype} {'x'.join(map(str, value.shape))}"
    if value.size and value.dtype.kind in "fiu":
        text += f", {np.nanmin(value):.4g} to {np.nanmax(value):.4g}"
    shown = {"items": [_scalar(v) for v in value.ravel()]} if 0 < value.size <= 2 * MAX_ITEMS else {}
    return {"type": "array", "text": text, **shown}


def _named(value: Any) -> Mapping[Any, Any] | None:
    if isinstance(value, Mapping):
        return value
    if hasattr(value, "_asdict"):
        return dict(value._asdict())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    return None
