"""`vlm.*` served by any OpenAI-compatible endpoint."""

from __future__ import annotations

from gap_perception.language import tools as contracts
from gap_perception.language.tools import Reply, Verdict
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Image

DEADLINE_S = 180.0  # a few tries of an endpoint that may be busy


@serves(contracts.vlm_query, provider="hf", deadline_s=DEADLINE_S)
def vlm_query(ctx: ToolContext, prompt: str, image: Image | None = None) -> Reply:
    """The endpoint's answer to a prompt about an image (default: the latest observation's first camera).

    The image is sent as PNG to the machine `GAP_HF_VLM_URL` names. Raises `BadRequestError` (`prompt`, `no_image`),
    `ToolError` (`setting`, `extra`, `unreachable`, `timeout`, `http`, `answer`).
    """
    return Reply(_ask(ctx, prompt, image))


@serves(contracts.vlm_query_yes_no, provider="hf", deadline_s=DEADLINE_S)
def vlm_query_yes_no(ctx: ToolContext, prompt: str, image: Image | None = None) -> Verdict:
    """As `vlm.Query`, for a yes-no question. Raises `PerceptionError` (`cannot_answer`) for any other answer."""
    from gap_hf.language.answers import ASK, yes_or_no

    return Verdict(yes_or_no(_ask(ctx, prompt, image, ASK)))


def _ask(ctx: ToolContext, prompt: str, image: Image | None, ending: str = "") -> str:
    from gap_hf.language.chat import ask
    from gap_hf.vision.pictures import check_prompt, pictures
    from gap_hf.vision.pixels import check_image

    check_prompt(prompt)
    (picture,) = pictures(ctx, image)
    check_image(picture)
    return ask(ctx, f"{prompt.strip()} {ending}".strip(), picture)


TOOLS = (vlm_query, vlm_query_yes_no)
