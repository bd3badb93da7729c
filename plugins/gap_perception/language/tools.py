"""Vision-language tools (`vlm.*`, `molmo.*`), embedded: plain questions answered from the scene analysis."""

from __future__ import annotations

from gap_catalogue.language import (
    MolmoQuery,
    MolmoQueryYesNo,
    PointedPixel,
    PointPrompt,
    Reply,
    VlmQuery,
    VlmQueryYesNo,
    YesNo,
)
from gap_catalogue.shared.frames import images_meant
from gap_runtime.contracts.failures import PerceptionError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Image


@serves(VlmQuery)
def vlm_query(ctx: ToolContext, request: VlmQuery) -> Reply:
    """Plain questions about what is where are answered, others by "cannot answer: ..." with the reason.

    Understood: is there / how many / what objects; what is this (a crop); is A left of, right of, in front of, behind,
    in, on, above, below, near B; which (kind) is nearest to B; where is A; and "Which numbered box shows A?".
    """
    return Reply(_ask(ctx, request.prompt, request.image))


@serves(VlmQueryYesNo)
def vlm_query_yes_no(ctx: ToolContext, request: VlmQueryYesNo) -> YesNo:
    return YesNo(_yes_no(ctx, request.prompt, request.image))


@serves(MolmoQuery)
def molmo_query(ctx: ToolContext, request: MolmoQuery) -> Reply:
    """As `vlm.Query`; of several cameras the first that gives an answer counts."""
    return Reply(_ask(ctx, request.prompt, request.image, every=request.use_multiview))


@serves(MolmoQueryYesNo)
def molmo_query_yes_no(ctx: ToolContext, request: MolmoQueryYesNo) -> YesNo:
    """Yes in any camera is yes."""
    return YesNo(_yes_no(ctx, request.prompt, request.image, every=request.use_multiview))


@serves(PointPrompt)
def molmo_point_prompt(ctx: ToolContext, request: PointPrompt) -> PointedPixel:
    """The pixel of the best match that is farthest from its outline."""
    from gap_perception.image_view import view_image
    from gap_perception.language.phrases import read_phrase
    from gap_perception.language.questions import PRESENT
    from gap_perception.language.relations import matches
    from gap_perception.points2d import deepest_pixel

    view = view_image(ctx, request.image)
    phrase = read_phrase(request.object_name, view.vocabulary)
    found = matches(view, phrase, PRESENT) if phrase else []
    if not found:
        return PointedPixel(0, 0, False)
    return PointedPixel(*deepest_pixel(found[0][1].mask), True)


def _ask(ctx: ToolContext, prompt: str, image: Image | None, *, every: bool = False) -> str:
    from gap_perception.image_view import view_image
    from gap_perception.language.questions import CANNOT, NotUnderstood, answer

    reasons = []
    for picture in images_meant(ctx, image, every):
        try:
            return answer(view_image(ctx, picture), prompt)
        except NotUnderstood as reason:
            reasons.append(str(reason))
        except PerceptionError as reason:
            reasons.append(reason.message)
    return f"{CANNOT}: {reasons[0]}"


def _yes_no(ctx: ToolContext, prompt: str, image: Image | None, *, every: bool = False) -> bool:
    from gap_perception.language.questions import CANNOT, yes_or_no

    answers = [_ask(ctx, prompt, picture) for picture in images_meant(ctx, image, every)]
    answered = [a for a in answers if not a.startswith(CANNOT)]
    if not answered:
        why = answers[0].removeprefix(f"{CANNOT}: ")
        raise PerceptionError("cannot_answer", f"Cannot answer {prompt[:80]!r}: {why}.")
    return any([yes_or_no(a) for a in answered])


TOOLS = (vlm_query, vlm_query_yes_no, molmo_query, molmo_query_yes_no, molmo_point_prompt)
