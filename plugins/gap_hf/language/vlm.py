"""`vlm.*` served by any OpenAI-compatible endpoint."""

from __future__ import annotations

from gap_catalogue.language import Reply, VlmQuery, VlmQueryYesNo, YesNo
from gap_catalogue.shared.frames import images_meant
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Image

DEADLINE_S = 180.0  # a few tries of an endpoint that may be busy


@serves(VlmQuery, provider="hf", deadline_s=DEADLINE_S)
def vlm_query(ctx: ToolContext, request: VlmQuery) -> Reply:
    """The endpoint's answer. The image is sent as PNG to the machine that `GAP_HF_VLM_URL` names.

    Raises `ToolError` (`setting`, `extra`, `unreachable`, `timeout`, `http`, `answer`) as well.
    """
    return Reply(_ask(ctx, request.prompt, request.image))


@serves(VlmQueryYesNo, provider="hf", deadline_s=DEADLINE_S)
def vlm_query_yes_no(ctx: ToolContext, request: VlmQueryYesNo) -> YesNo:
    """As `vlm.Query`; any other answer than yes or no is `cannot_answer`."""
    from gap_hf.language.parsing import ASK, yes_or_no

    return YesNo(yes_or_no(_ask(ctx, request.prompt, request.image, ASK)))


def _ask(ctx: ToolContext, prompt: str, image: Image | None, ending: str = "") -> str:
    from gap_hf.language.chat import ask
    from gap_hf.vision.pixels import check_image

    (picture,) = images_meant(ctx, image)
    check_image(picture)
    return ask(ctx, f"{prompt.strip()} {ending}".strip(), picture)


TOOLS = (vlm_query, vlm_query_yes_no)
