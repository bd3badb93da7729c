"""Finds a part of an object: detect the parent, crop to it, segment the part there, and merge the cameras in 3D."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.scripting import cloud_gap
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, BoundingBox2D, CameraObservation, Image, Mask, PointCloud


class Part(NamedTuple):
    """The part: its points from the cameras that agree, its mask in the whole image of the surest, and that score."""

    cloud: Annotated[PointCloud, WORLD]
    mask: Mask
    score: float


class View(NamedTuple):
    """The part in one camera."""

    score: float
    mask: Mask
    points: np.ndarray  # (N, 3) [m], world


def run(
    ctx: ScriptContext,
    cameras: list[CameraObservation],
    parent_prompt: str,
    subpart_prompt: str,
    box_threshold: float = 0.20,
    min_score: float = 0.10,
    margin: float = 0.10,
    min_points: int = 20,
    agree_within: float = 0.03,
) -> Part:
    """Perceive the part. Raises `PerceptionError` (`no_parent`, `not_found`)."""
    views: list[View] = []
    parents = 0
    for camera in cameras:
        found = ctx.tool(
            "grounding_dino.Detect", image=camera.rgb, text_prompt=f"{parent_prompt}.", box_threshold=box_threshold
        ).detections
        if not found:
            continue
        parents += 1
        view = segment(ctx, camera, found[0].box, subpart_prompt, margin)
        if view is not None and view.score >= min_score and len(view.points) >= min_points:
            views.append(view)
    if not parents:
        raise PerceptionError("no_parent", f"No camera shows the {parent_prompt}.")
    if not views:
        raise PerceptionError("not_found", f"The {parent_prompt} is seen, but not its part {subpart_prompt!r}.")
    best = max(views, key=lambda v: v.score)
    together = [best, *(v for v in views if v is not best and cloud_gap(v.points, best.points) <= agree_within)]
    return Part(PointCloud(np.concatenate([v.points for v in together])), best.mask, best.score)


def segment(
    ctx: ScriptContext, camera: CameraObservation, parent: BoundingBox2D, prompt: str, margin: float
) -> View | None:
    """The part inside the parent's box, with its mask put back into the whole image."""
    rows, columns = crop(parent, camera.rgb.data.shape[:2], margin)
    inside = Image(camera.rgb.data[rows, columns])
    segmented = ctx.tool("sam3.SegmentText", image=inside, text_prompt=prompt)
    if not segmented.masks:
        return None
    whole = np.zeros(camera.rgb.data.shape[:2], dtype=bool)
    whole[rows, columns] = segmented.masks[0].data
    mask = Mask(whole)
    cloud = ctx.tool(
        "geometry_svc.MaskToWorldPoints",
        mask=mask,
        depth=camera.depth,
        intrinsics=camera.intrinsics,
        camera_pose=camera.pose,
    )
    return View(segmented.scores[0], mask, cloud.points)


def crop(box: BoundingBox2D, shape: tuple[int, int], margin: float) -> tuple[slice, slice]:
    """Rows and columns of the box, widened by `margin` of its size on every side, inside an image of `shape`."""
    dx, dy = margin * (box.x_max - box.x_min), margin * (box.y_max - box.y_min)
    top, bottom = max(0, int(box.y_min - dy)), min(shape[0], int(np.ceil(box.y_max + dy)))
    left, right = max(0, int(box.x_min - dx)), min(shape[1], int(np.ceil(box.x_max + dx)))
    return slice(top, max(bottom, top + 1)), slice(left, max(right, left + 1))
