"""`sam2.Segment*` and `sam3.Segment*` served by the networks themselves."""

from __future__ import annotations

from gap_catalogue.checks import clipped
from gap_catalogue.segmentation import (
    NamedSegments,
    Sam2SegmentBox,
    Sam2SegmentPoint,
    Sam3SegmentBox,
    Sam3SegmentPoint,
    Sam3SegmentText,
    Segments,
)
from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import check_image
from gap_hf.vision.promptable_segmentation import SAM2, SAM3, Family, Prompt
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Image, Mask


@serves(Sam2SegmentPoint, provider="hf", deadline_s=DEADLINE_S)
def sam2_segment_point(ctx: ToolContext, request: Sam2SegmentPoint) -> Segments:
    """By SAM 2: up to three masks (part, object, group), best first by predicted IoU.

    Raises `ToolError` (`extra`, `weights`, `setting`) as well.
    """
    return _segments(SAM2, request.image, Prompt(point=(request.pixel_x, request.pixel_y)))


@serves(Sam3SegmentPoint, provider="hf", deadline_s=DEADLINE_S)
def sam3_segment_point(ctx: ToolContext, request: Sam3SegmentPoint) -> Segments:
    """By SAM 3: up to three masks, best first by predicted IoU. Raises `ToolError` (`extra`, `weights`, `setting`)."""
    return _segments(SAM3, request.image, Prompt(point=(request.pixel_x, request.pixel_y)))


@serves(Sam2SegmentBox, provider="hf", deadline_s=DEADLINE_S)
def sam2_segment_box(ctx: ToolContext, request: Sam2SegmentBox) -> Segments:
    """By SAM 2: its three alternatives at most, best first by predicted IoU.

    Raises `ToolError` (`extra`, `weights`, `setting`) as well.
    """
    return _segments(SAM2, request.image, Prompt(clipped(request.box, request.image)), request.max_masks)


@serves(Sam3SegmentBox, provider="hf", deadline_s=DEADLINE_S)
def sam3_segment_box(ctx: ToolContext, request: Sam3SegmentBox) -> Segments:
    """By SAM 3, which is shown box and point: up to three masks. Raises `ToolError` (`extra`, `weights`, `setting`)."""
    point = (request.pixel_x, request.pixel_y) if request.use_point else None
    return _segments(SAM3, request.image, Prompt(clipped(request.box, request.image), point))


@serves(Sam3SegmentText, provider="hf", deadline_s=DEADLINE_S)
def sam3_segment_text(ctx: ToolContext, request: Sam3SegmentText) -> NamedSegments:
    """Every instance that SAM 3 finds, from a score of 0.5. Raises `ToolError` (`extra`, `weights`, `setting`)."""
    from gap_hf.vision.concepts import instances

    check_image(request.image)
    found = instances(request.image, request.text_prompt.strip())
    return NamedSegments([Mask(i.mask) for i in found], [i.score for i in found], [i.box for i in found])


def _segments(family: Family, image: Image, prompt: Prompt, at_most: int = 0) -> Segments:
    """At most so many masks (0: all)."""
    from gap_hf.vision.promptable_segmentation import segment

    found = segment(family, image, prompt, several=at_most != 1)[: at_most or None]
    return Segments([Mask(mask) for _, mask in found], [score for score, _ in found])


TOOLS = (sam3_segment_text, sam3_segment_point, sam3_segment_box, sam2_segment_box, sam2_segment_point)
