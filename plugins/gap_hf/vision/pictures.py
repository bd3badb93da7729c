"""Which images a question is about: the given one, the other cameras of its moment, or the latest observation."""

from __future__ import annotations

from gap_perception.frames import find, latest
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Image

MAX_PROMPT = 8000  # characters, as in the contract's embedded provider


def pictures(ctx: ToolContext, image: Image | None, every: bool = False) -> list[Image]:
    """The images to look at; with `every`, all cameras of the observation `image` belongs to.

    Raises `BadRequestError` (`no_image`) when none was given and nothing was observed yet in this episode.
    """
    if image is not None and not every:
        return [image]
    found = None if image is None else find(ctx.state, image)
    if image is not None and found is None:
        return [image]
    scene = found.scene if found else latest(ctx.state)
    if scene is None or not scene.observation.cameras:
        raise BadRequestError(
            "no_image", "There is no image: none was given and nothing was observed yet.",
            hint="Call observation.GetObservation first, or pass an image.",
        )  # fmt: skip
    seen = [camera.rgb for camera in scene.observation.cameras]
    return seen if every else seen[:1]


def check_prompt(prompt: str) -> None:
    """Raises `BadRequestError` (`prompt`) for an empty prompt or one beyond 8000 characters."""
    if not prompt.strip() or len(prompt) > MAX_PROMPT:
        raise BadRequestError("prompt", f"The prompt has {len(prompt)} characters; 1 to {MAX_PROMPT} are read.")
