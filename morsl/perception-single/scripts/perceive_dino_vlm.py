"""Finds one object in every camera by detection and segmentation, and merges what the cameras agree on in 3D."""

from __future__ import annotations

import re
from typing import Annotated, NamedTuple

import numpy as np

from gap_cli.contracts.failures import PerceptionError
from gap_cli.contracts.tool import ScriptContext
from gap_cli.contracts.types import WORLD, CameraObservation, Detection, Mask, PointCloud

AGREEMENT_POINTS = 400  # per cloud; enough to tell clouds centimetres apart, few enough for all pairs
GRID = 0.002  # m: one point is kept per cell; finer than the depth, coarse enough for the noise filter to be quick


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
    rows = [
        f"{number}: [{d.box.x_min:.0f}, {d.box.y_min:.0f}, {d.box.x_max:.0f}, {d.box.y_max:.0f}]"
        for number, d in enumerate(detections, 1)
    ]
    question = prompt.replace("{object_name}", object_name).replace("{boxes}", "\n".join(rows))
    answer = ctx.tool("vlm.Query", prompt=question, image=camera.rgb).text.strip().lower()
    number = re.fullmatch(r"(?:box |number )?(\d+)\W*", answer)
    if number is not None and 1 <= int(number[1]) <= len(detections):
        return detections[int(number[1]) - 1]
    if answer.startswith("none"):
        return None
    return detections[0]  # it could not say: the detector's own order decides


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
    together = [first, *(v for v in views if v is not first and gap(v.points, first.points) <= agree_within)]
    most = max(together, key=lambda v: len(v.points))
    cloud = thinned(np.concatenate([v.points for v in together]))
    return Perceived(True, PointCloud(cloud), most.mask, first.score)


def thinned(points: np.ndarray) -> np.ndarray:
    """The first point of every occupied grid cell."""
    _, first = np.unique(np.floor(points / GRID).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]


def gap(a: np.ndarray, b: np.ndarray) -> float:
    """Smallest distance [m] between two clouds, on an even sample of each."""
    a, b = (points[:: len(points) // AGREEMENT_POINTS + 1] for points in (a, b))
    return float(np.linalg.norm(a[:, None] - b[None], axis=2).min())
