"""Writes a textured mesh as Wavefront .obj, .mtl and .png."""

from __future__ import annotations

import hashlib
import re
import tempfile
from pathlib import Path

import numpy as np

from gap_perception.models.mesh_views import MaskedView
from gap_perception.scene.points import project
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, OrientedBoundingBox

DIGITS = 6  # of a metre


def write_mesh(
    name: str, vertices: Array, faces: Array, obb: OrientedBoundingBox, view: MaskedView, folder: str
) -> tuple[str, str]:
    """Paths of the .obj and of its texture, which is cut from `view`. Raises `BadRequestError` (`output_dir`)."""
    import cv2

    stem = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "object"
    x0, y0, x1, y1 = _window(view.mask)
    uv = _texture_coordinates(vertices, obb, view, (x0, y0, x1, y1))
    lines = [f"mtllib {stem}.mtl", f"o {stem}"]
    lines += [f"v {x:.{DIGITS}f} {y:.{DIGITS}f} {z:.{DIGITS}f}" for x, y, z in vertices + 0.0]
    lines += [f"vt {u:.{DIGITS}f} {v:.{DIGITS}f}" for u, v in uv + 0.0]
    lines += [f"usemtl {stem}", *(f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in faces + 1)]
    text = "\n".join(lines) + "\n"
    ok, png = cv2.imencode(".png", view.camera.rgb.data[y0:y1, x0:x1, ::-1])
    if not ok:
        raise BadRequestError("texture", "The view's image cannot be written as PNG.")
    try:
        target = Path(folder) if folder else _temporary(text)
        target.mkdir(parents=True, exist_ok=True)
        (target / f"{stem}.png").write_bytes(png.tobytes())
        (target / f"{stem}.mtl").write_text(f"newmtl {stem}\nKd 1 1 1\nmap_Kd {stem}.png\n")
        (target / f"{stem}.obj").write_text(text)
    except OSError as error:
        raise BadRequestError(
            "output_dir", f"{folder or 'The temporary folder'} cannot be written: {error.strerror}."
        ) from None
    return str(target / f"{stem}.obj"), str(target / f"{stem}.png")


def _temporary(text: str) -> Path:
    return Path(tempfile.gettempdir()) / f"gap-mesh-{hashlib.blake2b(text.encode(), digest_size=8).hexdigest()}"


def _window(mask: Array) -> tuple[int, int, int, int]:
    """The mask's box, or the whole image for an empty mask."""
    from gap_perception.candidates import box_of

    return box_of(mask) if mask.any() else (0, 0, mask.shape[1], mask.shape[0])


def _texture_coordinates(
    vertices: Array, obb: OrientedBoundingBox, view: MaskedView, window: tuple[int, int, int, int]
) -> Array:
    """Where each vertex shows in the window, (V, 2) in 0..1, v upwards as .obj has it."""
    x0, y0, x1, y1 = window
    columns, rows, _ = project(obb.orientation.rotation.apply(vertices) + obb.center.array, view.camera)
    u = (columns - x0 + 0.5) / (x1 - x0)
    v = 1.0 - (rows - y0 + 0.5) / (y1 - y0)
    return np.clip(np.column_stack([u, v]), 0.0, 1.0)
