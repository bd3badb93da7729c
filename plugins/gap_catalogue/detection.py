"""Detection of named objects in an image: `grounding_dino.Detect`, `owlvit.Detect`."""

from __future__ import annotations

from typing import NamedTuple

from gap_catalogue.checks import check_fractions, phrases_of
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import Detection, Image


class Detections(NamedTuple):
    """What was found, best first."""

    detections: list[Detection]


class GroundingDinoDetect(ToolRequest[Detections], tool="grounding_dino.Detect", deadline_s=30.0):
    """Find what the period-separated phrases of `text_prompt` name; best first, nothing for what is not there.

    A phrase may hold a name, attributes, and a place or relation ("red can left of the basket"). `label` is the phrase,
    `score` the probability that the box shows it; boxes below `box_threshold` and words matched less surely than
    `text_threshold` are dropped.
    Raises `BadRequestError` for an empty or too long prompt or thresholds outside 0 to 1.
    """

    image: Image
    text_prompt: str
    box_threshold: float = 0.20
    text_threshold: float = 0.20

    def __post_init__(self) -> None:
        check_fractions(box_threshold=self.box_threshold, text_threshold=self.text_threshold)
        phrases_of(self.text_prompt.split("."))

    @property
    def phrases(self) -> list[str]:
        """What to look for, each phrase once."""
        return phrases_of(self.text_prompt.split("."))


class OwlvitDetect(ToolRequest[Detections], tool="owlvit.Detect", deadline_s=30.0):
    """Find what each of `text_queries` names; best first. Scores mean what they mean in `grounding_dino.Detect`.

    Raises `BadRequestError` for no queries, one too long, or a threshold outside 0 to 1.
    """

    image: Image
    text_queries: list[str]
    score_threshold: float = 0.05

    def __post_init__(self) -> None:
        check_fractions(score_threshold=self.score_threshold)
        phrases_of(self.text_queries)

    @property
    def phrases(self) -> list[str]:
        """What to look for, each query once."""
        return phrases_of(self.text_queries)
