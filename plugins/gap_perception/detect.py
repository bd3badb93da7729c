"""Detection tools (`grounding_dino.Detect`, `owlvit.Detect`), embedded: phrases matched to the task's object models."""

from __future__ import annotations

from collections.abc import Sequence

from gap_catalogue.detection import Detections, GroundingDinoDetect, OwlvitDetect
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Detection, Image


@serves(GroundingDinoDetect)
def grounding_dino_detect(ctx: ToolContext, request: GroundingDinoDetect) -> Detections:
    """By the task's object models: names, synonyms and attributes are read, places and relations judged by depth.

    `score` is the probability of the model given the segment. An image never observed in this episode is judged by
    colour alone, and its scores are lower.
    """
    return _detect(ctx, request.image, request.phrases, request.box_threshold, request.text_threshold)


@serves(OwlvitDetect)
def owlvit_detect(ctx: ToolContext, request: OwlvitDetect) -> Detections:
    return _detect(ctx, request.image, request.phrases, request.score_threshold, 0.0)


def _detect(
    ctx: ToolContext, image: Image, phrases: Sequence[str], box_threshold: float, text_threshold: float
) -> Detections:
    from gap_perception.image_view import view_image
    from gap_perception.language.phrases import read_phrase
    from gap_perception.language.relations import matches

    view = view_image(ctx, image)
    found: list[Detection] = []
    for text in phrases:
        phrase = read_phrase(text, view.vocabulary)
        if phrase is None or max(phrase.names.values()) < text_threshold:
            continue
        found += [Detection(c.bounds, text, score) for score, c in matches(view, phrase, box_threshold)]
    return Detections(sorted(found, key=lambda d: (-d.score, d.label, d.box.x_min, d.box.y_min)))


TOOLS = (grounding_dino_detect, owlvit_detect)
