"""Reads the loosely typed views a mesh is made from, and finds their depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gap_catalogue.shared.frames import find
from gap_runtime.contracts.encoding.codec import from_plain
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, CameraObservation, DepthImage, Image

FIELDS = {"rgb": "Image", "mask": "Mask", "intrinsics": "Matrix3x3", "camera_pose": "Se3Pose", "depth": "DepthImage?"}


@dataclass(frozen=True)
class MaskedView:
    """One calibrated RGB-D frame and the object's pixels in it, shape (H, W)."""

    camera: CameraObservation
    mask: Array


def read_views(ctx: ToolContext, views: list[Any]) -> list[MaskedView]:
    """The views with their depth. Raises `BadRequestError` saying which view is wrong and why."""
    if not views:
        raise BadRequestError("empty", "There is no view to make a mesh from.")
    return [_read(ctx, view, f"views[{i}]") for i, view in enumerate(views)]


def _read(ctx: ToolContext, view: Any, where: str) -> MaskedView:
    if not isinstance(view, Mapping) or not set(FIELDS) - {"depth"} <= set(view) <= set(FIELDS):
        raise BadRequestError("view", f"{where} must be a mapping with {', '.join(FIELDS)} (depth may be left out).")
    given = {name: from_plain(view.get(name), type_, where=f"{where}.{name}") for name, type_ in FIELDS.items()}
    depth = given["depth"] or _depth_of(ctx, given["rgb"], where)
    shapes = {given["rgb"].data.shape[:2], given["mask"].data.shape, depth.data.shape}
    if len(shapes) > 1:
        raise BadRequestError("shape", f"{where}: image, mask and depth differ in size: {sorted(shapes)}.")
    camera = CameraObservation(where, given["rgb"], depth, given["intrinsics"], given["camera_pose"])
    return MaskedView(camera, np.asarray(given["mask"].data))


def _depth_of(ctx: ToolContext, image: Image, where: str) -> DepthImage:
    found = find(ctx.state, image)
    if found is None:
        raise BadRequestError(
            "no_depth", f"{where}: the image was not observed in this episode and brings no depth.",
            hint="Use an image from observation.GetObservation, or add `depth` to the view.",
        )  # fmt: skip
    x, y = found.offset
    rows, columns = image.data.shape[:2]
    return DepthImage(found.camera.depth.data[y : y + rows, x : x + columns])
