"""`sam2.Segment*` and `sam3.Segment*` served by the networks themselves."""

from __future__ import annotations

from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import check_image, check_pixel, clipped
from gap_hf.vision.promptable_segmentation import SAM2, SAM3, Family, Prompt
from gap_perception import segment as contracts
from gap_perception.segment import NamedSegments, Segments
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Array, BoundingBox2D, Image, Mask


@serves(contracts.sam2_segment_point, provider="hf", deadline_s=DEADLINE_S)
def sam2_segment_point(ctx: ToolContext, image: Image, pixel_x: int, pixel_y: int) -> Segments:
    """What SAM 2 sees under a pixel: up to three masks (part, object, group), best first by predicted IoU.

    Raises `BadRequestError` (`outside`), `ToolError` (`extra`, `weights`, `setting`).
    """
    return _at_point(SAM2, image, pixel_x, pixel_y)


@serves(contracts.sam3_segment_point, provider="hf", deadline_s=DEADLINE_S)
def sam3_segment_point(ctx: ToolContext, image: Image, pixel_x: int, pixel_y: int) -> Segments:
    """What SAM 3 sees under a pixel: up to three masks, best first by predicted IoU.

    Raises `BadRequestError` (`outside`), `ToolError` (`extra`, `weights`, `setting`).
    """
    return _at_point(SAM3, image, pixel_x, pixel_y)


@serves(contracts.sam2_segment_box, provider="hf", deadline_s=DEADLINE_S)
def sam2_segment_box(ctx: ToolContext, image: Image, box: BoundingBox2D, max_masks: int = 0) -> Segments:
    """What SAM 2 sees in a box: at most `max_masks` masks (0: its three alternatives), best first by predicted IoU.

    Raises `BadRequestError` for a box without area inside the image or a negative `max_masks`, `ToolError` (`extra`,
    `weights`, `setting`).
    """
    if max_masks < 0:
        raise BadRequestError("range", f"max_masks is {max_masks}; 0 means all.")
    found = _segment(SAM2, image, Prompt(box=clipped(box, image)), several=max_masks != 1)
    return _segments(found[:max_masks] if max_masks else found)


@serves(contracts.sam3_segment_box, provider="hf", deadline_s=DEADLINE_S)
def sam3_segment_box(
    ctx: ToolContext, image: Image, box: BoundingBox2D, pixel_x: int = 0, pixel_y: int = 0, use_point: bool = False
) -> Segments:
    """What SAM 3 sees in a box, with `use_point` under a foreground pixel of it: up to three masks, best first.

    Raises `BadRequestError` for a box without area inside the image or a point outside it, `ToolError` (`extra`,
    `weights`, `setting`).
    """
    if use_point:
        check_pixel(image, pixel_x, pixel_y)
    point = (pixel_x, pixel_y) if use_point else None
    return _segments(_segment(SAM3, image, Prompt(clipped(box, image), point), several=True))


@serves(contracts.sam3_segment_text, provider="hf", deadline_s=DEADLINE_S)
def sam3_segment_text(ctx: ToolContext, image: Image, text_prompt: str) -> NamedSegments:
    """Every instance SAM 3 finds of a noun phrase, best first, from a score of 0.5; empty when there is none.

    Raises `BadRequestError` for an empty or too long prompt, `ToolError` (`extra`, `weights`, `setting`).
    """
    from gap_hf.vision.concepts import instances

    if not text_prompt.strip():
        raise BadRequestError("empty", "The text prompt is empty; write what to segment.")
    check_image(image)
    found = instances(image, text_prompt.strip())
    return NamedSegments([Mask(i.mask) for i in found], [i.score for i in found], [i.box for i in found])


def _at_point(family: Family, image: Image, x: int, y: int) -> Segments:
    check_pixel(image, x, y)
    return _segments(_segment(family, image, Prompt(point=(x, y)), several=True))


def _segment(family: Family, image: Image, prompt: Prompt, *, several: bool) -> list[tuple[float, Array]]:
    from gap_hf.vision.promptable_segmentation import segment

    return segment(family, image, prompt, several=several)


def _segments(found: list[tuple[float, Array]]) -> Segments:
    return Segments([Mask(mask) for _, mask in found], [score for score, _ in found])


TOOLS = (sam3_segment_text, sam3_segment_point, sam3_segment_box, sam2_segment_box, sam2_segment_point)
