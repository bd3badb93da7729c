"""The open trackers of an episode: how many there may be, what they are called, and which one a request means."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from typing import TypeVar

from gap_catalogue.shared.frames import digest
from gap_catalogue.tracking import InitTracker
from gap_runtime.contracts.failures import BadRequestError, did_you_mean

MAX_TRACKERS = 64
Track = TypeVar("Track")


def check_room(tracks: Collection[str]) -> None:
    """Raise `BadRequestError` (`too_many`) when `MAX_TRACKERS` are open."""
    if len(tracks) >= MAX_TRACKERS:
        raise BadRequestError("too_many", f"{len(tracks)} trackers are open.", hint="Close some: CloseTracker.")


def tracker_id(request: InitTracker, taken: Collection[str]) -> str:
    """An id from what was asked, not from a counter: parallel branches may start trackers in any order."""
    r = request
    content = f"{digest(r.image)}{r.text}{r.box}{r.pixel_x},{r.pixel_y},{r.use_point}{r.object_name}".encode()
    stem = f"{r.object_name or r.text or 'object'}-{hashlib.blake2b(content, digest_size=4).hexdigest()}"
    stem = stem.replace(" ", "_")
    name, copy = stem, 2
    while name in taken:
        name, copy = f"{stem}-{copy}", copy + 1
    return name


def open_tracker(tracks: Mapping[str, Track], tracker_id: str) -> Track:
    """The tracker of that id. Raises `BadRequestError` (`unknown_tracker`) when none is open."""
    if tracker_id not in tracks:
        raise BadRequestError(
            "unknown_tracker", f"No tracker {tracker_id!r} is open.", hint=did_you_mean(tracker_id, tracks)
        )
    return tracks[tracker_id]
