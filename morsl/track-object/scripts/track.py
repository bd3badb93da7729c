"""Follows one object through the observation stream and publishes a snapshot per frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any, NamedTuple

from gap_runtime.contracts.failures import CancelledError, PerceptionError
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import BoundingBox2D, Mask, Observation


class Snapshot(NamedTuple):
    """The object in one frame of one camera; `stamp` is world time [s]."""

    mask: Mask
    box: BoundingBox2D
    confidence: float
    object_present: bool
    camera_index: int
    stamp: float


def run(ctx: ScriptContext, observation_stream: Any, object_name: str, camera_index: int = 0) -> Iterator[Snapshot]:
    """Track `object_name` until the stream or the node ends. Raises `PerceptionError` (`not_found`, `no_camera`)."""
    frame = observation_stream.next()
    image = picture(frame, camera_index)
    started = ctx.tool("sam3_tracker.InitTracker", image=image, text=object_name, object_name=object_name)
    try:
        if not started.object_present:
            raise PerceptionError("not_found", f"The first frame does not show the {object_name}.")
        yield Snapshot(started.initial_mask, started.initial_box, started.score, True, camera_index, frame.stamp)
        while (frame := observation_stream.next()) is not None:
            image = picture(frame, camera_index)
            now = ctx.tool("sam3_tracker.UpdateTracker", tracker_id=started.tracker_id, image=image)
            yield Snapshot(now.mask, now.box, now.confidence, now.object_present, camera_index, frame.stamp)
    finally:
        close(ctx, started.tracker_id)


def picture(frame: Observation, index: int) -> Any:
    """The followed camera's image."""
    if index >= len(frame.cameras):
        raise PerceptionError("no_camera", f"There is no camera {index}; the observation has {len(frame.cameras)}.")
    return frame.cameras[index].rgb


def close(ctx: ScriptContext, tracker_id: str) -> None:
    """Free the tracker, also when told to stop; one that was given up on is freed with its episode."""
    with suppress(CancelledError), ctx.cleanup():
        ctx.tool("sam3_tracker.CloseTracker", tracker_id=tracker_id)
