"""`sam3_tracker.*` served by SAM 3's video tracker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gap_catalogue.checks import clipped
from gap_catalogue.shared.trackers import check_room, open_tracker, tracker_id
from gap_catalogue.tracking import CloseTracker, InitTracker, TrackedObject, TrackerStart, UpdateTracker
from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import bounds, check_image
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask

if TYPE_CHECKING:
    from gap_hf.vision.following import FollowedMask, FollowedObject

PRESENT = 0.5  # probability from which the object counts as in the frame, as in the network's own training
_KEY = "gap_hf.trackers"


@dataclass(frozen=True)
class Awaited:
    """An object named by a text that no frame has shown yet."""

    text: str


@serves(InitTracker, provider="hf", deadline_s=DEADLINE_S)
def init_tracker(ctx: ToolContext, request: InitTracker) -> TrackerStart:
    """By SAM 3: of a text the likeliest instance. A text that names nothing in the frame is looked for in each new one.

    A tracker wants frames of one size, in order. Raises `ToolError` (`extra`, `weights`, `setting`) as well.
    """
    check_image(request.image)
    tracks = _tracks(ctx)
    check_room(tracks)
    track, seen = _start(request)
    name = tracker_id(request, tracks)
    tracks[name] = track
    return TrackerStart(name, *_report(seen))


@serves(UpdateTracker, provider="hf", deadline_s=DEADLINE_S)
def update_tracker(ctx: ToolContext, request: UpdateTracker) -> TrackedObject:
    """`confidence` is the probability that the object is in the frame. Refuses a frame of another size."""
    from gap_hf.vision.following import follow

    track = open_tracker(_tracks(ctx), request.tracker_id)
    check_image(request.image)
    if isinstance(track, Awaited):
        track, seen = _look_for(track.text, request.image)
        _tracks(ctx)[request.tracker_id] = track
    else:
        seen = follow(track, request.image)
    return TrackedObject(*_report(seen))


@serves(CloseTracker, provider="hf")
def close_tracker(ctx: ToolContext, request: CloseTracker) -> None:
    """Frees the memory that its network kept, too."""
    from gap_hf.vision.following import stop

    track = open_tracker(_tracks(ctx), request.tracker_id)
    if not isinstance(track, Awaited):
        stop(track)
    _tracks(ctx).pop(request.tracker_id, None)


def _start(request: InitTracker) -> tuple[FollowedObject | Awaited, FollowedMask]:
    from gap_hf.vision.following import start
    from gap_hf.vision.promptable_segmentation import Prompt

    if request.text.strip():
        return _look_for(request.text.strip(), request.image)
    box = clipped(request.box, request.image) if request.box is not None else None
    return start(request.image, Prompt(box, request.point))


def _look_for(text: str, image: Image) -> tuple[FollowedObject | Awaited, FollowedMask]:
    """Follow the likeliest instance of `text`, or wait for one."""
    from gap_hf.vision.concepts import instances
    from gap_hf.vision.following import FollowedMask, start
    from gap_hf.vision.promptable_segmentation import Prompt

    found = instances(image, text)
    if found:
        return start(image, Prompt(), found[0].mask)
    return Awaited(text), FollowedMask(np.zeros(image.data.shape[:2], dtype=bool), 0.0)


def _report(seen: FollowedMask) -> tuple[Mask, BoundingBox2D, float, bool]:
    there = seen.chance > PRESENT and bool(seen.mask.any())
    mask = seen.mask if there else np.zeros_like(seen.mask)
    return Mask(mask), bounds(mask), seen.chance, there


def _tracks(ctx: ToolContext) -> dict[str, FollowedObject | Awaited]:
    tracks: dict[str, FollowedObject | Awaited] = ctx.state.setdefault(_KEY, {})
    return tracks


TOOLS = (init_tracker, update_tracker, close_tracker)
