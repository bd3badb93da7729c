"""Tracking tools (`sam3_tracker.*`), embedded: objects followed by what they are and where they were."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gap_catalogue.shared.trackers import check_room, open_tracker, tracker_id
from gap_catalogue.tracking import CloseTracker, InitTracker, TrackedObject, TrackerStart, UpdateTracker
from gap_runtime.contracts.tool import ToolContext, serves

if TYPE_CHECKING:
    from gap_perception.tracking.mask_tracking import Track

_KEY = "gap_perception.trackers"


@serves(InitTracker)
def init_tracker(ctx: ToolContext, request: InitTracker) -> TrackerStart:
    from gap_perception.tracking.mask_tracking import start

    tracks = _tracks(ctx)
    check_room(tracks)
    track, seen = start(ctx, request.image, request.text.strip(), request.box, request.point)
    name = tracker_id(request, tracks)
    tracks[name] = track
    return TrackerStart(name, *seen)


@serves(UpdateTracker)
def update_tracker(ctx: ToolContext, request: UpdateTracker) -> TrackedObject:
    from gap_perception.tracking.mask_tracking import follow

    track, seen = follow(ctx, open_tracker(_tracks(ctx), request.tracker_id), request.image)
    _tracks(ctx)[request.tracker_id] = track
    return TrackedObject(*seen)


@serves(CloseTracker)
def close_tracker(ctx: ToolContext, request: CloseTracker) -> None:
    open_tracker(_tracks(ctx), request.tracker_id)
    _tracks(ctx).pop(request.tracker_id, None)


def _tracks(ctx: ToolContext) -> dict[str, Track]:
    tracks: dict[str, Track] = ctx.state.setdefault(_KEY, {})
    return tracks


TOOLS = (init_tracker, update_tracker, close_tracker)
