"""Objects followed from frame to frame: `sam3_tracker.*`."""

from __future__ import annotations

from typing import NamedTuple

from gap_catalogue.checks import check_pixel, clipped
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask


class TrackerStart(NamedTuple):
    """A tracker's id and what it saw first: mask, box and score; an empty mask and box when nothing was there."""

    tracker_id: str
    initial_mask: Mask
    initial_box: BoundingBox2D
    score: float
    object_present: bool


class TrackedObject(NamedTuple):
    """The object in the new frame; an empty mask and box when it is not there."""

    mask: Mask
    box: BoundingBox2D
    confidence: float
    object_present: bool


class InitTracker(ToolRequest[TrackerStart], tool="sam3_tracker.InitTracker", effect="sense", deadline_s=30.0):
    """Start to follow what `text` names, or what a box or (with `use_point`) a pixel of the first frame holds.

    The tracker lives until it is closed or the episode ends.
    Raises `BadRequestError` unless exactly one of text, box and point is given, for a box or a pixel outside the image,
    and when too many trackers are open.
    """

    image: Image
    text: str = ""
    box: BoundingBox2D | None = None
    pixel_x: int = 0
    pixel_y: int = 0
    use_point: bool = False
    object_name: str = ""

    def __post_init__(self) -> None:
        given = [bool(self.text.strip()), self.box is not None, self.use_point]
        if sum(given) != 1:
            raise BadRequestError("seed", f"Give exactly one of text, box and point to track; got {sum(given)}.")
        if self.use_point:
            check_pixel(self.image, self.pixel_x, self.pixel_y)
        if self.box is not None:
            clipped(self.box, self.image)

    @property
    def point(self) -> tuple[int, int] | None:
        """The pixel (x, y), where one was given."""
        return (self.pixel_x, self.pixel_y) if self.use_point else None


class UpdateTracker(ToolRequest[TrackedObject], tool="sam3_tracker.UpdateTracker", effect="sense", deadline_s=30.0):
    """Find a tracker's object in a new frame. Raises `BadRequestError` for a tracker that is not open."""

    tracker_id: str
    image: Image


class CloseTracker(ToolRequest[None], tool="sam3_tracker.CloseTracker", effect="sense"):
    """Free a tracker. Raises `BadRequestError` for one that is not open."""

    tracker_id: str
