"""Segmentation from a box or a point: SAM 2 (`Sam2Model`) and the promptable half of SAM 3 (`Sam3TrackerModel`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gap_hf.loading import Network, network
from gap_hf.vision.pixels import HALVES, IMAGENET, Square, to_array, to_image
from gap_runtime.contracts.types import Array, Image

FOREGROUND = 1  # label of a point on the object


@dataclass(frozen=True)
class Family:
    """One of the promptable networks, and how its training normalised images."""

    service: str
    architecture: str
    channels: tuple[tuple[float, float, float], tuple[float, float, float]]

    def load(self) -> Network:
        """The network. Raises what `loading.network` raises."""
        return network(self.service, self.architecture)

    def square(self, model: Any) -> Square:
        """The network's input."""
        side = model.config.prompt_encoder_config.image_size
        return Square(int(side if isinstance(side, int) else side[0]), *self.channels)


SAM2 = Family("sam2", "Sam2Model", IMAGENET)
SAM3 = Family("sam3", "Sam3TrackerModel", HALVES)


@dataclass(frozen=True)
class Prompt:
    """What to segment, in pixels of the image: a box (x0, y0, x1, y1), a foreground point (x, y), or both."""

    box: tuple[float, float, float, float] | None = None
    point: tuple[float, float] | None = None


def segment(family: Family, image: Image, prompt: Prompt, *, several: bool) -> list[tuple[float, Array]]:
    """(predicted IoU, mask of the image's size), best first; with `several`, the network's alternatives, else its one.

    Masks without a pixel are left out.
    """
    loaded = family.load()
    with loaded.running() as model:
        square = family.square(model)
        device = loaded.place.device
        found = model(
            pixel_values=square.pixels(image, device),
            multimask_output=several,
            **prompts(square, image, prompt, device),
        )
        masks = to_array(to_image(found.pred_masks[0, 0], image) > 0)
        scores = to_array(found.iou_scores[0, 0].float().clamp(0, 1))
    ranked = sorted(zip(scores, masks, strict=True), key=lambda pair: -pair[0])
    return [(float(score), mask) for score, mask in ranked if mask.any()]


def prompts(square: Square, image: Image, prompt: Prompt, device: Any) -> dict[str, Any]:
    """The prompt as the networks take it: one image, one object."""
    import torch

    inputs: dict[str, Any] = {}
    if prompt.box is not None:
        inputs["input_boxes"] = square.points([prompt.box[:2], prompt.box[2:]], image, device).view(1, 1, 4)
    if prompt.point is not None:
        inputs["input_points"] = square.points([prompt.point], image, device).view(1, 1, 1, 2)
        inputs["input_labels"] = torch.full((1, 1, 1), FOREGROUND, dtype=torch.int32, device=device)
    return inputs
