"""One opinion per camera: what lies under the pixel the pointing model names."""

from __future__ import annotations

from typing import NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import CameraObservation, ObjectMask


class Opinions(NamedTuple):
    """Masks and how sure the segmenter is of each (0 to 1)."""

    masks: list[ObjectMask]
    scores: list[float]


def run(ctx: ScriptContext, cameras: list[CameraObservation], object_name: str) -> Opinions:
    """At most one mask per camera; none where the model does not point."""
    found = Opinions([], [])
    for index, camera in enumerate(cameras):
        point = ctx.tool("molmo.PointPrompt", image=camera.rgb, object_name=object_name)
        if not point.found:
            continue
        segmented = ctx.tool("sam3.SegmentPoint", image=camera.rgb, pixel_x=point.pixel_x, pixel_y=point.pixel_y)
        if segmented.masks:
            found.masks.append(ObjectMask("point", segmented.masks[0], index))
            found.scores.append(segmented.scores[0])
    return found
