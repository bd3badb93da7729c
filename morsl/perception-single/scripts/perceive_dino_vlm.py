"""Finds one object in every camera by detection and segmentation, and merges what the cameras agree on in 3D."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.scripting import cloud_gap, named_index, numbered_question, thinned
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, CameraObservation, Detection, Mask, PointCloud


class Perceived(NamedTuple):
    """The object as the cameras saw it: merged cloud, the mask of the camera that saw most of it, and how sure."""

    found: bool
    cloud: Annotated[PointCloud, WORLD]
    mask: Mask
    score: float


class View(NamedTuple):
    """The object in one camera."""

    score: float
    mask: Mask
    points: np.ndarray  # (N, 3) [m], world


def run(
    ctx: ScriptContext,
    cameras: list[CameraObservation],
    object_name: str,
    prompt: str,
    box_threshold: float = 0.20,
    text_threshold: float = 0.20,
    min_score: float = 0.30,
    min_points: int = 60,
    agree_within: float = 0.05,
) -> Perceived:
    """Perceive `object_name`. Raises `PerceptionError` (`not_found`) when no camera shows it surely enough."""
    views: list[View] = []
    best = 0.0
    for camera in cameras:
        found = ctx.tool(
            "grounding_dino.Detect",
            image=camera.rgb,
            text_prompt=f"{object_name}.",
            box_threshold=box_threshold,
            text_threshold=text_threshold,
        ).detections
        best = max([best, *(d.score for d in found)])
        detection = select(ctx, camera, [d for d in found if d.score >= min_score], object_name, prompt)
        view = None if detection is None else lift(ctx, camera, detection)
        if view is not None and len(view.points) >= min_points:
            views.append(view)
    if not views:
        raise PerceptionError(
            "not_found",
            f"No camera shows the {object_name} with a score of {min_score} and {min_points} points.",
            detail={"cameras": [c.name for c in cameras], "best_score": best},
        )
    return merge(views, agree_within)


def select(
    ctx: ScriptContext, camera: CameraObservation, detections: list[Detection], object_name: str, prompt: str
) -> Detection | None:
    """The one detection that shows the object: the only one, or the one the vision-language model names."""
    if len(detections) <= 1:
        return detections[0] if detections else None
    question = numbered_question(prompt, object_name, [d.box for d in detections])
    answer = ctx.tool("vlm.Query", prompt=question, image=camera.rgb).text
    named = named_index(answer, len(detections))
    if named is None and answer.strip().lower().startswith("none"):
        return None
    return detections[named or 0]  # where it could not say, the detector's own order decides


def lift(ctx: ScriptContext, camera: CameraObservation, detection: Detection) -> View | None:
    """Segment the detection and back-project its pixels to the world frame."""
    segmented = ctx.tool("sam3.SegmentBox", image=camera.rgb, box=detection.box)
    if not segmented.masks:
        return None
    mask = segmented.masks[0]
    cloud = ctx.tool(
        "geometry_svc.MaskToWorldPoints",
        mask=mask,
        depth=camera.depth,
        intrinsics=camera.intrinsics,
        camera_pose=camera.pose,
    )
    return View(detection.score, mask, cloud.points)


def merge(views: list[View], agree_within: float) -> Perceived:
    """The best view, joined by every other whose cloud touches it."""
    first = max(views, key=lambda v: v.score)
    together = [first, *(v for v in views if v is not first and cloud_gap(v.points, first.points) <= agree_within)]
    most = max(together, key=lambda v: len(v.points))
    cloud = thinned(np.concatenate([v.points for v in together]))
    return Perceived(True, PointCloud(cloud), most.mask, first.score)
