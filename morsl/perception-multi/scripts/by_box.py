"""One opinion per camera: the detector's best box, segmented."""

from __future__ import annotations

from typing import NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import CameraObservation, ObjectMask


class Opinions(NamedTuple):
    """Masks and how sure the detector is of each (0 to 1)."""

    masks: list[ObjectMask]
    scores: list[float]


def run(
    ctx: ScriptContext, cameras: list[CameraObservation], object_name: str, box_threshold: float = 0.20
) -> Opinions:
    """At most one mask per camera; none where the detector finds nothing."""
    found = Opinions([], [])
    for index, camera in enumerate(cameras):
        detections = ctx.tool(
            "grounding_dino.Detect", image=camera.rgb, text_prompt=f"{object_name}.", box_threshold=box_threshold
        ).detections
        if not detections:
            continue
        segmented = ctx.tool("sam3.SegmentBox", image=camera.rgb, box=detections[0].box)
        if segmented.masks:
            found.masks.append(ObjectMask("box", segmented.masks[0], index))
            found.scores.append(detections[0].score)
    return found
