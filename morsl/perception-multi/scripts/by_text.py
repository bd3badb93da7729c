"""One opinion per camera: the best mask of the text segmenter."""

from __future__ import annotations

from typing import NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import CameraObservation, ObjectMask


class Opinions(NamedTuple):
    """Masks and how sure the segmenter is of each (0 to 1)."""

    masks: list[ObjectMask]
    scores: list[float]


def run(ctx: ScriptContext, cameras: list[CameraObservation], object_name: str) -> Opinions:
    """At most one mask per camera; none where the segmenter finds nothing."""
    found = Opinions([], [])
    for index, camera in enumerate(cameras):
        segmented = ctx.tool("sam3.SegmentText", image=camera.rgb, text_prompt=object_name)
        if segmented.masks:
            found.masks.append(ObjectMask("text", segmented.masks[0], index))
            found.scores.append(segmented.scores[0])
    return found
