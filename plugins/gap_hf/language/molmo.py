"""`molmo.*` served by Molmo 2 (`Molmo2ForConditionalGeneration`)."""

from __future__ import annotations

from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import check_image
from gap_perception.language import tools as contracts
from gap_perception.language.tools import Pointed, Reply, Verdict
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Image


@serves(contracts.molmo_query, provider="hf", deadline_s=DEADLINE_S)
def molmo_query(ctx: ToolContext, prompt: str, image: Image | None = None, use_multiview: bool = False) -> Reply:
    """Molmo 2's answer to a prompt about an image (default: the latest observation's first camera), greedily decoded.

    With `use_multiview`, all cameras of the image's observation are shown at once, in their order.
    Raises `BadRequestError` (`prompt`, `no_image`), `ToolError` (`extra`, `weights`, `setting`).
    """
    from gap_hf.language.generation import reply
    from gap_hf.vision.pictures import check_prompt, pictures

    check_prompt(prompt)
    return Reply(reply(ctx, prompt, pictures(ctx, image, use_multiview)))


@serves(contracts.molmo_query_yes_no, provider="hf", deadline_s=DEADLINE_S)
def molmo_query_yes_no(
    ctx: ToolContext, prompt: str, image: Image | None = None, use_multiview: bool = False
) -> Verdict:
    """As `molmo.Query`, for a yes-no question. Raises `PerceptionError` (`cannot_answer`) for any other answer."""
    from gap_hf.language.answers import ASK, yes_or_no
    from gap_hf.language.generation import reply
    from gap_hf.vision.pictures import check_prompt, pictures

    check_prompt(prompt)
    return Verdict(yes_or_no(reply(ctx, f"{prompt.strip()} {ASK}", pictures(ctx, image, use_multiview))))


@serves(contracts.molmo_point_prompt, provider="hf", deadline_s=DEADLINE_S)
def molmo_point_prompt(ctx: ToolContext, image: Image, object_name: str) -> Pointed:
    """The first pixel Molmo 2 points at for `object_name`; `found` is false when it points at none.

    Raises `BadRequestError` for an empty name, `ToolError` (`extra`, `weights`, `setting`).
    """
    from gap_hf.language.generation import reply
    from gap_hf.language.pointing import pixel, points

    if not object_name.strip():
        raise BadRequestError("empty", "object_name is empty; write what to point at.")
    check_image(image)
    found = points(reply(ctx, f"Point to the {object_name.strip()}.", [image]))
    if not found:
        return Pointed(0, 0, False)
    rows, columns = image.data.shape[:2]
    return Pointed(*pixel(found[0], columns, rows), True)


TOOLS = (molmo_query, molmo_query_yes_no, molmo_point_prompt)
