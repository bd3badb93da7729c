"""Vision-language tools (`vlm.*`, `molmo.*`), embedded: plain questions answered from the scene analysis."""

from __future__ import annotations

from typing import NamedTuple

from gap_perception.frames import DEADLINE_S, find, latest
from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Image

MAX_PROMPT = 8000  # characters


class Reply(NamedTuple):
    """What was answered."""

    text: str


class Verdict(NamedTuple):
    """Yes or no."""

    answer: bool


class Pointed(NamedTuple):
    """A pixel on the object, x to the right and y down; (0, 0) where `found` is false."""

    pixel_x: int
    pixel_y: int
    found: bool


@tool("vlm.Query", deadline_s=DEADLINE_S)
def vlm_query(ctx: ToolContext, prompt: str, image: Image | None = None) -> Reply:
    """Answer a question about an image (default: the latest observation's first camera) in as few words as it takes.

    Understood: is there / how many / what objects; what is this (a crop); is A left of, right of, in front of, behind,
    in, on, above, below, near B; which (kind) is nearest to B; where is A; and "Which numbered box shows A?" followed
    by lines "1: [x_min, y_min, x_max, y_max]", answered by a number or "none". Anything else is answered by
    "cannot answer: ..." with the reason.
    Raises `BadRequestError` for an empty prompt, or without an image when nothing was observed yet.
    """
    return Reply(_ask(ctx, prompt, image))


@tool("vlm.QueryYesNo", deadline_s=DEADLINE_S)
def vlm_query_yes_no(ctx: ToolContext, prompt: str, image: Image | None = None) -> Verdict:
    """Answer a yes-no question about an image (default: the latest observation's first camera).

    Raises `PerceptionError` (`cannot_answer`) for a question beyond this provider, `BadRequestError` as `vlm.Query`.
    """
    return Verdict(_yes_no(ctx, prompt, image))


@tool("molmo.Query", deadline_s=DEADLINE_S)
def molmo_query(ctx: ToolContext, prompt: str, image: Image | None = None, use_multiview: bool = False) -> Reply:
    """As `vlm.Query`; with `use_multiview`, the first camera of the image's observation that gives an answer counts."""
    return Reply(_ask(ctx, prompt, image, every=use_multiview))


@tool("molmo.QueryYesNo", deadline_s=DEADLINE_S)
def molmo_query_yes_no(
    ctx: ToolContext, prompt: str, image: Image | None = None, use_multiview: bool = False
) -> Verdict:
    """As `vlm.QueryYesNo`; with `use_multiview`, yes in any camera of the image's observation is yes."""
    return Verdict(_yes_no(ctx, prompt, image, every=use_multiview))


@tool("molmo.PointPrompt", deadline_s=DEADLINE_S)
def molmo_point_prompt(ctx: ToolContext, image: Image, object_name: str) -> Pointed:
    """A pixel well inside the best match for `object_name`; `found` is false when there is none.

    Raises `BadRequestError` for an empty name.
    """
    from gap_perception.language.phrases import read_phrase
    from gap_perception.language.questions import PRESENT
    from gap_perception.language.relations import matches
    from gap_perception.models.views import see
    from gap_perception.points2d import deepest_pixel

    if not object_name.strip():
        raise BadRequestError("empty", "object_name is empty; write what to point at.")
    view = see(ctx, image)
    phrase = read_phrase(object_name, view.vocabulary)
    found = matches(view, phrase, PRESENT) if phrase else []
    if not found:
        return Pointed(0, 0, False)
    return Pointed(*deepest_pixel(found[0][1].mask), True)


def _ask(ctx: ToolContext, prompt: str, image: Image | None, *, every: bool = False) -> str:
    from gap_perception.language.questions import CANNOT, NotUnderstood, answer
    from gap_perception.models.views import see

    _check(prompt)
    reasons = []
    for picture in _pictures(ctx, image, every):
        try:
            return answer(see(ctx, picture), prompt)
        except NotUnderstood as reason:
            reasons.append(str(reason))
        except PerceptionError as reason:
            reasons.append(reason.message)
    return f"{CANNOT}: {reasons[0]}"


def _yes_no(ctx: ToolContext, prompt: str, image: Image | None, *, every: bool = False) -> bool:
    from gap_perception.language.questions import CANNOT, yes_or_no

    _check(prompt)
    answers = [_ask(ctx, prompt, picture) for picture in _pictures(ctx, image, every)]
    answered = [a for a in answers if not a.startswith(CANNOT)]
    if not answered:
        why = answers[0].removeprefix(f"{CANNOT}: ")
        raise PerceptionError("cannot_answer", f"Cannot answer {prompt[:80]!r}: {why}.")
    return any([yes_or_no(a) for a in answered])


def _check(prompt: str) -> None:
    if not prompt.strip() or len(prompt) > MAX_PROMPT:
        raise BadRequestError("prompt", f"The prompt has {len(prompt)} characters; 1 to {MAX_PROMPT} are read.")


def _pictures(ctx: ToolContext, image: Image | None, every: bool) -> list[Image]:
    if image is not None and not every:
        return [image]
    found = None if image is None else find(ctx.state, image)
    scene = found.scene if found else latest(ctx.state)
    if image is not None and found is None:
        return [image]
    if scene is None or not scene.observation.cameras:
        raise BadRequestError(
            "no_image", "There is no image: none was given and nothing was observed yet.",
            hint="Call observation.GetObservation first, or pass an image.",
        )  # fmt: skip
    pictures = [camera.rgb for camera in scene.observation.cameras]
    return pictures if every else pictures[:1]


TOOLS = (vlm_query, vlm_query_yes_no, molmo_query, molmo_query_yes_no, molmo_point_prompt)
