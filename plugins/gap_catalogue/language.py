"""Questions about images: `vlm.*`, `molmo.*`."""

from __future__ import annotations

from typing import NamedTuple

from gap_catalogue.checks import check_prompt
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import Image


class Reply(NamedTuple):
    """What was answered."""

    text: str


class YesNo(NamedTuple):
    """Yes or no."""

    answer: bool


class PointedPixel(NamedTuple):
    """A pixel on the object, x to the right and y down; (0, 0) where `found` is false."""

    pixel_x: int
    pixel_y: int
    found: bool


class VlmQuery(ToolRequest[Reply], tool="vlm.Query", deadline_s=30.0):
    """Answer a prompt about an image (default: the latest observation's first camera) in as few words as it takes.

    "Which numbered box shows A?" followed by lines "1: [x_min, y_min, x_max, y_max]" is answered by a number or "none".
    Raises `BadRequestError` for an empty or too long prompt, or without an image when nothing was observed yet.
    """

    prompt: str
    image: Image | None = None

    def __post_init__(self) -> None:
        check_prompt(self.prompt)


class VlmQueryYesNo(ToolRequest[YesNo], tool="vlm.QueryYesNo", deadline_s=30.0):
    """Answer a yes-no question about an image (default: the latest observation's first camera).

    Raises `PerceptionError` (`cannot_answer`) for a question that is not answered so, `BadRequestError` as `vlm.Query`.
    """

    prompt: str
    image: Image | None = None

    def __post_init__(self) -> None:
        check_prompt(self.prompt)


class MolmoQuery(ToolRequest[Reply], tool="molmo.Query", deadline_s=30.0):
    """As `vlm.Query`; with `use_multiview`, all cameras of the image's observation count."""

    prompt: str
    image: Image | None = None
    use_multiview: bool = False

    def __post_init__(self) -> None:
        check_prompt(self.prompt)


class MolmoQueryYesNo(ToolRequest[YesNo], tool="molmo.QueryYesNo", deadline_s=30.0):
    """As `vlm.QueryYesNo`; with `use_multiview`, all cameras of the image's observation count."""

    prompt: str
    image: Image | None = None
    use_multiview: bool = False

    def __post_init__(self) -> None:
        check_prompt(self.prompt)


class PointPrompt(ToolRequest[PointedPixel], tool="molmo.PointPrompt", deadline_s=30.0):
    """A pixel on the best match for `object_name`; `found` is false when there is none.

    Raises `BadRequestError` for an empty name.
    """

    image: Image
    object_name: str

    def __post_init__(self) -> None:
        if not self.object_name.strip():
            raise BadRequestError("empty", "object_name is empty; write what to point at.")
