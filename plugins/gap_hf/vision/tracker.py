"""`sam3_tracker.*` served by SAM 3's video tracker."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import bounds, check_image, check_pixel, clipped
from gap_perception.frames import digest
from gap_perception.tracking import tools as contracts
from gap_perception.tracking.tools import MAX_TRACKERS, Started, Tracked
from gap_runtime.contracts.failures import BadRequestError, did_you_mean
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask

if TYPE_CHECKING:
    from gap_hf.vision.following import Seen, Track

PRESENT = 0.5  # probability from which the object counts as in the frame, as in the network's own training
_KEY = "gap_hf.trackers"


@dataclass(frozen=True)
class Awaited:
    """An object named by a text that no frame has shown yet."""

    text: str


@serves(contracts.init_tracker, provider="hf", deadline_s=DEADLINE_S)
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
    """Start to follow, with SAM 3, the likeliest instance of `text`, or what a box or a pixel of the first frame holds.

    A text that names nothing in the frame is looked for again in each new one. A tracker lives until it is closed or
    the episode ends, and wants frames of one size, in order.
    Raises `BadRequestError` unless exactly one of text, box and point is given, and when too many trackers are open;
    `ToolError` (`extra`, `weights`, `setting`).
    """
    given = [bool(text.strip()), box is not None, use_point]
    if sum(given) != 1:
        raise BadRequestError("seed", f"Give exactly one of text, box and point to track; got {sum(given)}.")
    check_image(image)
    tracks = _tracks(ctx)
    if len(tracks) >= MAX_TRACKERS:
        raise BadRequestError("too_many", f"{len(tracks)} trackers are open.", hint="Close some: CloseTracker.")
    if use_point:
        check_pixel(image, pixel_x, pixel_y)
    if text.strip():
        track, seen = _look_for(text.strip(), image)
    else:
        track, seen = _held(image, box, (pixel_x, pixel_y) if use_point else None)
    name = _name(f"{digest(image)}{text}{box}{pixel_x},{pixel_y},{use_point}", object_name or text or "object", tracks)
    tracks[name] = track
    return Started(name, *_report(seen))


@serves(contracts.update_tracker, provider="hf", deadline_s=DEADLINE_S)
def update_tracker(ctx: ToolContext, tracker_id: str, image: Image) -> Tracked:
    """Find a tracker's object in a new frame. `confidence` is the probability that the object is in it.

    Raises `BadRequestError` for a tracker that is not open or a frame of another size.
    """
    from gap_hf.vision.following import follow

    track = _open(ctx, tracker_id)
    check_image(image)
    if isinstance(track, Awaited):
        track, seen = _look_for(track.text, image)
        _tracks(ctx)[tracker_id] = track
    else:
        seen = follow(track, image)
    return Tracked(*_report(seen))


@serves(contracts.close_tracker, provider="hf")
def close_tracker(ctx: ToolContext, tracker_id: str) -> None:
    """Free a tracker and the memory its network kept. Raises `BadRequestError` for one that is not open."""
    from gap_hf.vision.following import stop

    track = _open(ctx, tracker_id)
    if not isinstance(track, Awaited):
        stop(track)
    _tracks(ctx).pop(tracker_id, None)


def _look_for(text: str, image: Image) -> tuple[Track | Awaited, Seen]:
    """Follow the likeliest instance of `text`, or wait for one."""
    from gap_hf.vision.concepts import instances
    from gap_hf.vision.following import Seen, start
    from gap_hf.vision.promptable_segmentation import Prompt

    found = instances(image, text)
    if found:
        return start(image, Prompt(), found[0].mask)
    return Awaited(text), Seen(np.zeros(image.data.shape[:2], dtype=bool), 0.0)


def _held(image: Image, box: BoundingBox2D | None, point: tuple[int, int] | None) -> tuple[Track, Seen]:
    from gap_hf.vision.following import start
    from gap_hf.vision.promptable_segmentation import Prompt

    return start(image, Prompt(clipped(box, image) if box is not None else None, point))


def _report(seen: Seen) -> tuple[Mask, BoundingBox2D, float, bool]:
    there = seen.chance > PRESENT and bool(seen.mask.any())
    mask = seen.mask if there else np.zeros_like(seen.mask)
    return Mask(mask), bounds(mask), seen.chance, there


def _name(content: str, label: str, taken: Mapping[str, object]) -> str:
    """An id from what was asked, not from a counter: parallel branches may start trackers in any order."""
    stem = f"{label}-{hashlib.blake2b(content.encode(), digest_size=4).hexdigest()}".replace(" ", "_")
    name, copy = stem, 2
    while name in taken:
        name, copy = f"{stem}-{copy}", copy + 1
    return name


def _tracks(ctx: ToolContext) -> dict[str, Track | Awaited]:
    tracks: dict[str, Track | Awaited] = ctx.state.setdefault(_KEY, {})
    return tracks


def _open(ctx: ToolContext, tracker_id: str) -> Track | Awaited:
    tracks = _tracks(ctx)
    if tracker_id not in tracks:
        raise BadRequestError(
            "unknown_tracker", f"No tracker {tracker_id!r} is open.", hint=did_you_mean(tracker_id, tracks)
        )
    return tracks[tracker_id]


TOOLS = (init_tracker, update_tracker, close_tracker)
