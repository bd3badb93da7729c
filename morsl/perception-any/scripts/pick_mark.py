"""Numbers what the detector finds, lets a vision-language model pick one number or none, and gathers its points."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.scripting import cloud_gap, named_index, numbered_question, thinned
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, CameraObservation, Detection, Mask, PointCloud


class Picked(NamedTuple):
    """The object picked: its points from all cameras that see it, its mask in the camera that was asked, its score."""

    cloud: Annotated[PointCloud, WORLD]
    mask: Mask
    score: float


class View(NamedTuple):
    """One detection segmented and back-projected."""

    score: float
    mask: Mask
    points: np.ndarray  # (N, 3) [m], world


def run(
    ctx: ScriptContext,
    cameras: list[CameraObservation],
    object_name: str,
    prompt: str,
    box_threshold: float = 0.15,
    max_marks: int = 9,
    min_points: int = 60,
    agree_within: float = 0.05,
) -> Picked:
    """Pick one. Raises `PerceptionError` (`not_found`) when no camera shows any."""
    marks = [detect(ctx, camera, object_name, box_threshold)[:max_marks] for camera in cameras]
    for index, camera in enumerate(cameras):
        chosen = ask(ctx, camera, marks[index], object_name, prompt)
        view = None if chosen is None else lift(ctx, camera, chosen)
        if view is None or len(view.points) < min_points:
            continue
        more = [touching(ctx, c, marks[i], view, agree_within) for i, c in enumerate(cameras) if i != index]
        cloud = np.concatenate([view.points, *(m for m in more if m is not None)])
        return Picked(PointCloud(thinned(cloud)), view.mask, view.score)
    raise PerceptionError(
        "not_found",
        f"No camera shows any {object_name}.",
        detail={"marks": [len(m) for m in marks], "cameras": [c.name for c in cameras]},
    )


def detect(ctx: ScriptContext, camera: CameraObservation, object_name: str, threshold: float) -> list[Detection]:
    """What the detector finds in one camera, best first."""
    found = ctx.tool("grounding_dino.Detect", image=camera.rgb, text_prompt=f"{object_name}.", box_threshold=threshold)
    return list(found.detections)


def ask(
    ctx: ScriptContext, camera: CameraObservation, marks: list[Detection], object_name: str, prompt: str
) -> Detection | None:
    """The mark the model names; None for none, for no marks, and for an answer that is not understood."""
    if not marks:
        return None
    question = numbered_question(prompt, object_name, [d.box for d in marks])
    named = named_index(ctx.tool("vlm.Query", prompt=question, image=camera.rgb).text, len(marks))
    return None if named is None else marks[named]


def touching(
    ctx: ScriptContext, camera: CameraObservation, marks: list[Detection], picked: View, within: float
) -> np.ndarray | None:
    """Points (N, 3) of the first mark in another camera that touches the picked object."""
    for detection in marks:
        view = lift(ctx, camera, detection)
        if view is not None and len(view.points) and cloud_gap(view.points, picked.points) <= within:
            return view.points
    return None


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
