"""`molmo.*` served by Molmo 2 (`Molmo2ForConditionalGeneration`)."""

from __future__ import annotations

from gap_catalogue.language import MolmoQuery, MolmoQueryYesNo, PointedPixel, PointPrompt, Reply, YesNo
from gap_catalogue.shared.frames import images_meant
from gap_hf.loading import DEADLINE_S
from gap_runtime.contracts.tool import ToolContext, serves


@serves(MolmoQuery, provider="hf", deadline_s=DEADLINE_S)
def molmo_query(ctx: ToolContext, request: MolmoQuery) -> Reply:
    """Molmo 2's answer, greedily decoded; several cameras are shown at once, in their order.

    Raises `ToolError` (`extra`, `weights`, `setting`) as well.
    """
    from gap_hf.language.generation import reply

    return Reply(reply(ctx, request.prompt, images_meant(ctx, request.image, request.use_multiview)))


@serves(MolmoQueryYesNo, provider="hf", deadline_s=DEADLINE_S)
def molmo_query_yes_no(ctx: ToolContext, request: MolmoQueryYesNo) -> YesNo:
    """As `molmo.Query`; any other answer than yes or no is `cannot_answer`."""
    from gap_hf.language.generation import reply
    from gap_hf.language.parsing import ASK, yes_or_no

    images = images_meant(ctx, request.image, request.use_multiview)
    return YesNo(yes_or_no(reply(ctx, f"{request.prompt.strip()} {ASK}", images)))


@serves(PointPrompt, provider="hf", deadline_s=DEADLINE_S)
def molmo_point_prompt(ctx: ToolContext, request: PointPrompt) -> PointedPixel:
    """The first pixel that Molmo 2 points at. Raises `ToolError` (`extra`, `weights`, `setting`) as well."""
    from gap_hf.language.generation import reply
    from gap_hf.language.parsing import pixel, points

    found = points(reply(ctx, f"Point to the {request.object_name.strip()}.", [request.image]))
    if not found:
        return PointedPixel(0, 0, False)
    rows, columns = request.image.data.shape[:2]
    return PointedPixel(*pixel(found[0], columns, rows), True)


TOOLS = (molmo_query, molmo_query_yes_no, molmo_point_prompt)
