"""Tracking tools (`sam3_tracker.*`), embedded: objects followed by what they are and where they were."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, NamedTuple

from gap_perception.frames import DEADLINE_S, digest
from gap_runtime.contracts.failures import BadRequestError, did_you_mean
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask

if TYPE_CHECKING:
    from gap_perception.tracking.mask_tracking import Track

MAX_TRACKERS = 64
_KEY = "gap_perception.trackers"


class Started(NamedTuple):
    """A tracker's id and what it saw first: mask, box and score; an empty mask and box when nothing was there."""

    tracker_id: str
    initial_mask: Mask
    initial_box: BoundingBox2D
    score: float
    object_present: bool


class Tracked(NamedTuple):
    """The object in the new frame; an empty mask and box when it is not there."""

    mask: Mask
    box: BoundingBox2D
    confidence: float
    object_present: bool


@tool("sam3_tracker.InitTracker", effect="sense", deadline_s=DEADLINE_S)
def init_tracker(
    ctx: ToolContext,
    image: Image,
    text: str = "",
    box: BoundingBox2D | None = None,
    pixel_x: int = 0,
    pixel_y: int = 0,
    use_point: bool = False,
    object_name: str = "",
) -> Started:
    """Start to follow what `text` names, or what a box or (with `use_point`) a pixel of the first frame holds.

    The tracker lives until it is closed or the episode ends.
    Raises `BadRequestError` unless exactly one of text, box and point is given, and when too many trackers are open.
    """
    from gap_perception.tracking.mask_tracking import start

    given = [bool(text.strip()), box is not None, use_point]
    if sum(given) != 1:
        raise BadRequestError("seed", f"Give exactly one of text, box and point to track; got {sum(given)}.")
    tracks = _tracks(ctx)
    if len(tracks) >= MAX_TRACKERS:
        raise BadRequestError("too_many", f"{len(tracks)} trackers are open.", hint="Close some: CloseTracker.")
    track, seen = start(ctx, image, text, box, (pixel_x, pixel_y) if use_point else None)
    # Named by content, not by a counter: parallel branches may start trackers in any order.
    content = f"{digest(image)}{text}{box}{pixel_x},{pixel_y},{use_point}{object_name}".encode()
    stem = f"{object_name or text or 'object'}-{hashlib.blake2b(content, digest_size=4).hexdigest()}".replace(" ", "_")
    name, copy = stem, 2
    while name in tracks:
        name, copy = f"{stem}-{copy}", copy + 1
    tracks[name] = track
    return Started(name, *seen)


@tool("sam3_tracker.UpdateTracker", effect="sense", deadline_s=DEADLINE_S)
def update_tracker(ctx: ToolContext, tracker_id: str, image: Image) -> Tracked:
    """Find a tracker's object in a new frame. Raises `BadRequestError` for a tracker that is not open."""
    from gap_perception.tracking.mask_tracking import follow

    track, seen = follow(ctx, _open(ctx, tracker_id), image)
    _tracks(ctx)[tracker_id] = track
    return Tracked(*seen)


@tool("sam3_tracker.CloseTracker", effect="sense")
def close_tracker(ctx: ToolContext, tracker_id: str) -> None:
    """Free a tracker. Raises `BadRequestError` for one that is not open."""
    _open(ctx, tracker_id)
    _tracks(ctx).pop(tracker_id, None)


def _tracks(ctx: ToolContext) -> dict[str, Track]:
    tracks: dict[str, Track] = ctx.state.setdefault(_KEY, {})
    return tracks


def _open(ctx: ToolContext, tracker_id: str) -> Track:
    tracks = _tracks(ctx)
    if tracker_id not in tracks:
        raise BadRequestError(
            "unknown_tracker", f"No tracker {tracker_id!r} is open.", hint=did_you_mean(tracker_id, tracks)
        )
    return tracks[tracker_id]


TOOLS = (init_tracker, update_tracker, close_tracker)
