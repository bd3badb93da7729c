"""`grounding_dino.Detect` and `owlvit.Detect` served by Grounding DINO and OWL-ViT (or OWLv2)."""

from __future__ import annotations

from gap_catalogue.detection import Detections, GroundingDinoDetect, OwlvitDetect
from gap_hf.loading import DEADLINE_S
from gap_hf.vision.pixels import check_image
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Detection


@serves(GroundingDinoDetect, provider="hf", deadline_s=DEADLINE_S)
def grounding_dino_detect(ctx: ToolContext, request: GroundingDinoDetect) -> Detections:
    """By Grounding DINO: a box belongs to the phrase that holds its likeliest word, whose probability is the `score`.

    Boxes that do not reach both thresholds are dropped. Raises `ToolError` (`extra`, `weights`, `setting`) as well.
    """
    from gap_hf.vision.grounding import ground

    check_image(request.image)
    return _ranked(ground(request.image, request.phrases, max(request.box_threshold, request.text_threshold)))


@serves(OwlvitDetect, provider="hf", deadline_s=DEADLINE_S)
def owlvit_detect(ctx: ToolContext, request: OwlvitDetect) -> Detections:
    """By OWL-ViT or OWLv2; a box belongs to its likeliest query. Raises `ToolError` (`extra`, `weights`, `setting`)."""
    from gap_hf.vision.owl import owl_detect

    check_image(request.image)
    return _ranked(owl_detect(request.image, request.phrases, request.score_threshold))


def _ranked(found: list[Detection]) -> Detections:
    return Detections(sorted(found, key=lambda d: (-d.score, d.label, d.box.x_min, d.box.y_min)))


TOOLS = (grounding_dino_detect, owlvit_detect)
