"""`grounding_dino.Detect` and `owlvit.Detect` served by Grounding DINO and OWL-ViT (or OWLv2)."""

from __future__ import annotations

from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import check_image
from gap_perception import detect as contracts
from gap_perception.detect import MAX_PHRASES, Detections
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Detection, Image


@serves(contracts.grounding_dino_detect, provider="hf", deadline_s=DEADLINE_S)
def grounding_dino_detect(
    ctx: ToolContext, image: Image, text_prompt: str, box_threshold: float = 0.20, text_threshold: float = 0.20
) -> Detections:
    """Find what the period-separated phrases of `text_prompt` name, best first, with Grounding DINO.

    A box belongs to the phrase that holds its likeliest word; `score` is that word's probability. Boxes that reach
    neither `box_threshold` nor `text_threshold` are dropped, and so are those that reach only one.
    Raises `BadRequestError` for an empty or too long prompt or thresholds outside 0 to 1, `ToolError` (`extra`,
    `weights`, `setting`).
    """
    from gap_hf.vision.grounding import ground

    wanted = _phrases(text_prompt.split("."))
    _check(image, box_threshold=box_threshold, text_threshold=text_threshold)
    return _ranked(ground(image, wanted, max(box_threshold, text_threshold)))


@serves(contracts.owlvit_detect, provider="hf", deadline_s=DEADLINE_S)
def owlvit_detect(ctx: ToolContext, image: Image, text_queries: list[str], score_threshold: float = 0.05) -> Detections:
    """Find what each of `text_queries` names, best first, with OWL-ViT or OWLv2; a box belongs to its likeliest query.

    Raises `BadRequestError` for no queries, one too long, or a threshold outside 0 to 1, `ToolError` (`extra`,
    `weights`, `setting`).
    """
    from gap_hf.vision.owl import look

    wanted = _phrases(text_queries)
    _check(image, score_threshold=score_threshold)
    return _ranked(look(image, wanted, score_threshold))


def _check(image: Image, **thresholds: float) -> None:
    for name, value in thresholds.items():
        if not 0 <= value <= 1:
            raise BadRequestError("range", f"{name} is {value}; it must lie between 0 and 1.")
    check_image(image)


def _phrases(texts: list[str]) -> list[str]:
    wanted = list(dict.fromkeys(text.strip() for text in texts if text.strip()))
    if not 0 < len(wanted) <= MAX_PHRASES:
        raise BadRequestError(
            "empty" if not wanted else "too_many",
            f"The prompt holds {len(wanted)} phrases; 1 to {MAX_PHRASES} can be looked for.",
            hint='Write what to find, phrases ended by periods: "alphabet soup. basket."',
        )
    return wanted


def _ranked(found: list[Detection]) -> Detections:
    return Detections(sorted(found, key=lambda d: (-d.score, d.label, d.box.x_min, d.box.y_min)))


TOOLS = (grounding_dino_detect, owlvit_detect)
