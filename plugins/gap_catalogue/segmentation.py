"""Masks from text, points and boxes: `sam2.*`, `sam3.*`."""

from __future__ import annotations

from typing import NamedTuple

from gap_catalogue.checks import check_pixel, clipped
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask


class Segments(NamedTuple):
    """Masks of the image's size, best first, and how well each fills the request (0 to 1)."""

    masks: list[Mask]
    scores: list[float]


class NamedSegments(NamedTuple):
    """Masks of the image's size, best first, the probability that each is what the text says, and their boxes."""

    masks: list[Mask]
    scores: list[float]
    boxes: list[BoundingBox2D]


class Sam3SegmentText(ToolRequest[NamedSegments], tool="sam3.SegmentText", deadline_s=30.0):
    """Every segment that `text_prompt`, a noun phrase, names; empty when there is none.

    Raises `BadRequestError` for an empty or too long prompt.
    """

    image: Image
    text_prompt: str

    def __post_init__(self) -> None:
        if not self.text_prompt.strip():
            raise BadRequestError("empty", "The text prompt is empty; write what to segment.")


class Sam3SegmentPoint(ToolRequest[Segments], tool="sam3.SegmentPoint", deadline_s=30.0):
    """What a pixel is on. Raises `BadRequestError` (`outside`) for a pixel outside the image."""

    image: Image
    pixel_x: int
    pixel_y: int

    def __post_init__(self) -> None:
        check_pixel(self.image, self.pixel_x, self.pixel_y)


class Sam2SegmentPoint(ToolRequest[Segments], tool="sam2.SegmentPoint", deadline_s=30.0):
    """What a pixel is on. Raises `BadRequestError` (`outside`) for a pixel outside the image."""

    image: Image
    pixel_x: int
    pixel_y: int

    def __post_init__(self) -> None:
        check_pixel(self.image, self.pixel_x, self.pixel_y)


class Sam3SegmentBox(ToolRequest[Segments], tool="sam3.SegmentBox", deadline_s=30.0):
    """The segments that fill a box best; with `use_point`, those under a foreground pixel come first.

    Raises `BadRequestError` for a box without area inside the image, or a point outside it.
    """

    image: Image
    box: BoundingBox2D
    pixel_x: int = 0
    pixel_y: int = 0
    use_point: bool = False

    def __post_init__(self) -> None:
        if self.use_point:
            check_pixel(self.image, self.pixel_x, self.pixel_y)
        clipped(self.box, self.image)


class Sam2SegmentBox(ToolRequest[Segments], tool="sam2.SegmentBox", deadline_s=30.0):
    """The segments that fill a box best, at most `max_masks` of them (0: all).

    Raises `BadRequestError` for a box without area inside the image, or a negative `max_masks`.
    """

    image: Image
    box: BoundingBox2D
    max_masks: int = 0

    def __post_init__(self) -> None:
        if self.max_masks < 0:
            raise BadRequestError("range", f"max_masks is {self.max_masks}; 0 means all.")
        clipped(self.box, self.image)
