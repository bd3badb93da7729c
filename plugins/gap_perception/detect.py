"""Detection tools (`grounding_dino.Detect`, `owlvit.Detect`), embedded: phrases matched to the task's object models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from gap_perception.frames import DEADLINE_S
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Detection, Image

MAX_PHRASES = 64


class Detections(NamedTuple):
    """What was found, best first."""

    detections: list[Detection]


@tool("grounding_dino.Detect", deadline_s=DEADLINE_S)
def grounding_dino_detect(
    ctx: ToolContext, image: Image, text_prompt: str, box_threshold: float = 0.20, text_threshold: float = 0.20
) -> Detections:
    """Find what the period-separated phrases of `text_prompt` name; best first, nothing for what is not there.

    A phrase may hold a name, synonym, attributes, and a place or relation ("red can left of the basket"). `label` is
    the phrase. `score` is the probability that the segment is what the phrase says, given the task's object models;
    boxes below `box_threshold` and words understood less surely than `text_threshold` are dropped. An image never
    observed in this episode is judged by colour alone, and its scores are lower.
    Raises `BadRequestError` for an empty prompt or thresholds outside 0 to 1.
    """
    return _detect(ctx, image, text_prompt.split("."), box_threshold, text_threshold)


@tool("owlvit.Detect", deadline_s=DEADLINE_S)
def owlvit_detect(ctx: ToolContext, image: Image, text_queries: list[str], score_threshold: float = 0.05) -> Detections:
    """Find what each of `text_queries` names; best first. Scores mean what they mean in `grounding_dino.Detect`.

    Raises `BadRequestError` for no queries or a threshold outside 0 to 1.
    """
    return _detect(ctx, image, text_queries, score_threshold, 0.0)


def _detect(
    ctx: ToolContext, image: Image, phrases: Sequence[str], box_threshold: float, text_threshold: float
) -> Detections:
    from gap_perception.language.phrases import read_phrase
    from gap_perception.language.relations import matches
    from gap_perception.models.views import see

    for name, value in (("box_threshold", box_threshold), ("text_threshold", text_threshold)):
        if not 0 <= value <= 1:
            raise BadRequestError("range", f"{name} is {value}; it must lie between 0 and 1.")
    wanted = [text.strip() for text in phrases if text.strip()]
    if not 0 < len(wanted) <= MAX_PHRASES:
        raise BadRequestError(
            "empty" if not wanted else "too_many",
            f"The prompt holds {len(wanted)} phrases; 1 to {MAX_PHRASES} can be looked for.",
            hint='Write what to find, phrases ended by periods: "alphabet soup. basket."',
        )
    view = see(ctx, image)
    found: list[Detection] = []
    for text in dict.fromkeys(wanted):
        phrase = read_phrase(text, view.vocabulary)
        if phrase is None or max(phrase.names.values()) < text_threshold:
            continue
        found += [Detection(c.bounds, text, score) for score, c in matches(view, phrase, box_threshold)]
    return Detections(sorted(found, key=lambda d: (-d.score, d.label, d.box.x_min, d.box.y_min)))


TOOLS = (grounding_dino_detect, owlvit_detect)
