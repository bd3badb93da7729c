"""Numbers what the detector finds, lets a vision-language model pick one number or none, and gathers its points."""

from __future__ import annotations

import re
from typing import Annotated, NamedTuple

import numpy as np

from gap_cli.contracts.failures import PerceptionError
from gap_cli.contracts.tool import ScriptContext
from gap_cli.contracts.types import WORLD, CameraObservation, Detection, Mask, PointCloud

AGREEMENT_POINTS = 400  # per cloud; enough to tell clouds centimetres apart, few enough for all pairs
GRID = 0.002  # m: one point is kept per cell; finer than the depth, coarse enough for the noise filter to be quick


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
    rows = [
        f"{number}: [{d.box.x_min:.0f}, {d.box.y_min:.0f}, {d.box.x_max:.0f}, {d.box.y_max:.0f}]"
        for number, d in enumerate(marks, 1)
    ]
    question = prompt.replace("{object_name}", object_name).replace("{boxes}", "\n".join(rows))
    answer = ctx.tool("vlm.Query", prompt=question, image=camera.rgb).text.strip().lower()
    number = re.fullmatch(r"(?:box |number )?(\d+)\W*", answer)
    return marks[int(number[1]) - 1] if number is not None and 1 <= int(number[1]) <= len(marks) else None


def touching(
    ctx: ScriptContext, camera: CameraObservation, marks: list[Detection], picked: View, within: float
) -> np.ndarray | None:
    """Points (N, 3) of the first mark in another camera that touches the picked object."""
    for detection in marks:
        view = lift(ctx, camera, detection)
        if view is not None and len(view.points) and gap(view.points, picked.points) <= within:
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


def gap(a: np.ndarray, b: np.ndarray) -> float:
    """Smallest distance [m] between two clouds, on an even sample of each."""
    a, b = (points[:: len(points) // AGREEMENT_POINTS + 1] for points in (a, b))
    return float(np.linalg.norm(a[:, None] - b[None], axis=2).min())


def thinned(points: np.ndarray) -> np.ndarray:
    """The first point of every occupied grid cell."""
    _, first = np.unique(np.floor(points / GRID).astype(np.int64), axis=0, return_index=True)
    return points[np.sort(first)]
