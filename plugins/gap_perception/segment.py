"""Segmentation tools (`sam2.*`, `sam3.Segment*`), embedded: segments of the scene analysis, or of colour alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gap_perception.frames import DEADLINE_S
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import BoundingBox2D, Image, Mask

if TYPE_CHECKING:
    from gap_runtime.contracts.types import Array


class Segments(NamedTuple):
    """Masks of the image's size, best first, and how well each fills the request (0 to 1)."""

    masks: list[Mask]
    scores: list[float]


class NamedSegments(NamedTuple):
    """Masks of the image's size, best first, the probability that each is what the text says, and their boxes."""

    masks: list[Mask]
    scores: list[float]
    boxes: list[BoundingBox2D]


@tool("sam3.SegmentText", deadline_s=DEADLINE_S)
def sam3_segment_text(ctx: ToolContext, image: Image, text_prompt: str) -> NamedSegments:
    """Every segment that `text_prompt` names; empty when there is none. The text is read as by `grounding_dino.Detect`.

    It may also name a part, `handle` or `rim`, of an object whose model has one: "handle of the frying pan", "rim".
    Raises `BadRequestError` for an empty prompt.
    """
    from gap_perception.language.phrases import read_phrase
    from gap_perception.language.relations import matches
    from gap_perception.models.views import see
    from gap_perception.parts import named_parts

    if not text_prompt.strip():
        raise BadRequestError("empty", "The text prompt is empty; write what to segment.")
    view = see(ctx, image)
    phrase = read_phrase(text_prompt, view.vocabulary)
    if phrase is not None:
        found = matches(view, phrase, TEXT_SCORE)
    else:
        found = named_parts(ctx, image, view, text_prompt, TEXT_SCORE)
    return NamedSegments([Mask(c.mask) for _, c in found], [s for s, _ in found], [c.bounds for _, c in found])


@tool("sam3.SegmentPoint", deadline_s=DEADLINE_S)
def sam3_segment_point(ctx: ToolContext, image: Image, pixel_x: int, pixel_y: int) -> Segments:
    """The segment under a pixel; empty over a support or the background.

    Raises `BadRequestError` (`outside`) for a pixel outside the image.
    """
    return _at_point(ctx, image, pixel_x, pixel_y)


@tool("sam2.SegmentPoint", deadline_s=DEADLINE_S)
def sam2_segment_point(ctx: ToolContext, image: Image, pixel_x: int, pixel_y: int) -> Segments:
    """The segment under a pixel; empty over a support or the background.

    Raises `BadRequestError` (`outside`) for a pixel outside the image.
    """
    return _at_point(ctx, image, pixel_x, pixel_y)


@tool("sam3.SegmentBox", deadline_s=DEADLINE_S)
def sam3_segment_box(
    ctx: ToolContext, image: Image, box: BoundingBox2D, pixel_x: int = 0, pixel_y: int = 0, use_point: bool = False
) -> Segments:
    """The segments that fill a box best; with `use_point`, those under the foreground pixel come first.

    A box on part of an object gives what of the object lies inside it; one on a bare support gives nothing.
    Raises `BadRequestError` for a box without area inside the image, or a point outside it.
    """
    from gap_perception.boxes import fill

    if use_point:
        check_pixel(image, pixel_x, pixel_y)
    found = fill(ctx, image, box)
    if use_point:
        found = sorted(found, key=lambda f: not f[1][pixel_y, pixel_x])
    return _segments(found)


@tool("sam2.SegmentBox", deadline_s=DEADLINE_S)
def sam2_segment_box(ctx: ToolContext, image: Image, box: BoundingBox2D, max_masks: int = 0) -> Segments:
    """The segments that fill a box best, at most `max_masks` of them (0: all).

    Raises `BadRequestError` for a box without area inside the image, or a negative `max_masks`.
    """
    from gap_perception.boxes import fill

    if max_masks < 0:
        raise BadRequestError("range", f"max_masks is {max_masks}; 0 means all.")
    found = fill(ctx, image, box)
    return _segments(found[:max_masks] if max_masks else found)


TEXT_SCORE = 0.2  # probability from which SegmentText returns a segment, as Detect's default threshold


def _at_point(ctx: ToolContext, image: Image, x: int, y: int) -> Segments:
    from gap_perception.models.views import see

    check_pixel(image, x, y)
    hit = [c for c in see(ctx, image).candidates if c.mask[y, x]]
    return Segments([Mask(c.mask) for c in hit], [max(c.scores.values(), default=0.5) for c in hit])


def check_pixel(image: Image, x: int, y: int) -> None:
    """Raise `BadRequestError` (`outside`) unless the pixel is in the image."""
    rows, columns = image.data.shape[:2]
    if not (0 <= x < columns and 0 <= y < rows):
        raise BadRequestError("outside", f"Pixel ({x}, {y}) is outside the {columns}x{rows} image.")


def _segments(found: list[tuple[float, Array]]) -> Segments:
    return Segments([Mask(mask) for _, mask in found], [score for score, _ in found])


TOOLS = (sam3_segment_text, sam3_segment_point, sam3_segment_box, sam2_segment_box, sam2_segment_point)
