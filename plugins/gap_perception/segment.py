"""Segmentation tools (`sam2.*`, `sam3.Segment*`), embedded: segments of the scene analysis, or of colour alone."""

from __future__ import annotations

from gap_catalogue.segmentation import (
    NamedSegments,
    Sam2SegmentBox,
    Sam2SegmentPoint,
    Sam3SegmentBox,
    Sam3SegmentPoint,
    Sam3SegmentText,
    Segments,
)
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, Mask

TEXT_SCORE = 0.2  # probability from which SegmentText returns a segment, as Detect's default threshold


@serves(Sam3SegmentText)
def sam3_segment_text(ctx: ToolContext, request: Sam3SegmentText) -> NamedSegments:
    """The text is read as by `grounding_dino.Detect`.

    It may also name a part, `handle` or `rim`, of an object whose model has one: "handle of the frying pan", "rim".
    """
    from gap_perception.image_view import view_image
    from gap_perception.language.phrases import read_phrase
    from gap_perception.language.relations import matches
    from gap_perception.parts import named_parts

    view = view_image(ctx, request.image)
    phrase = read_phrase(request.text_prompt, view.vocabulary)
    if phrase is not None:
        found = matches(view, phrase, TEXT_SCORE)
    else:
        found = named_parts(ctx, request.image, view, request.text_prompt, TEXT_SCORE)
    return NamedSegments([Mask(c.mask) for _, c in found], [s for s, _ in found], [c.bounds for _, c in found])


@serves(Sam3SegmentPoint)
def sam3_segment_point(ctx: ToolContext, request: Sam3SegmentPoint) -> Segments:
    """One segment; none over a support or the background."""
    return _at_point(ctx, request)


@serves(Sam2SegmentPoint)
def sam2_segment_point(ctx: ToolContext, request: Sam2SegmentPoint) -> Segments:
    """One segment; none over a support or the background."""
    return _at_point(ctx, request)


@serves(Sam3SegmentBox)
def sam3_segment_box(ctx: ToolContext, request: Sam3SegmentBox) -> Segments:
    """A box on part of an object gives what of the object lies inside it; one on a bare support gives nothing."""
    from gap_perception.boxes import fill

    found = fill(ctx, request.image, request.box)
    if request.use_point:
        found = sorted(found, key=lambda f: not f[1][request.pixel_y, request.pixel_x])
    return _segments(found)


@serves(Sam2SegmentBox)
def sam2_segment_box(ctx: ToolContext, request: Sam2SegmentBox) -> Segments:
    from gap_perception.boxes import fill

    return _segments(fill(ctx, request.image, request.box)[: request.max_masks or None])


def _at_point(ctx: ToolContext, request: Sam2SegmentPoint | Sam3SegmentPoint) -> Segments:
    from gap_perception.image_view import view_image

    hit = [c for c in view_image(ctx, request.image).candidates if c.mask[request.pixel_y, request.pixel_x]]
    return _segments([(max(c.scores.values(), default=0.5), c.mask) for c in hit])


def _segments(found: list[tuple[float, Array]]) -> Segments:
    return Segments([Mask(mask) for _, mask in found], [score for score, _ in found])


TOOLS = (sam3_segment_text, sam3_segment_point, sam3_segment_box, sam2_segment_box, sam2_segment_point)
