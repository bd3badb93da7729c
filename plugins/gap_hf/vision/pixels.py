"""Between images of the cell and a network's square input: pixels and prompts in, masks and boxes back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, BoundingBox2D, Image

IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))  # SAM 2 (Ravi et al., 2024): mean and deviation per channel
HALVES = ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5))  # SAM 3 (Carion et al., 2025)


@dataclass(frozen=True)
class Square:
    """A network's input: `side` pixels both ways, whatever the image's aspect, channels normalised by mean and std."""

    side: int
    mean: tuple[float, float, float]
    std: tuple[float, float, float]

    def pixels(self, image: Image, device: Any) -> Any:
        """The image resized (bilinear, antialiased, rounded to bytes) and normalised, (1, 3, side, side) float32."""
        import torch

        x = torch.from_numpy(np.array(image.data)).to(device).permute(2, 0, 1)[None].float()
        size = (self.side, self.side)
        x = torch.nn.functional.interpolate(x, size, mode="bilinear", align_corners=False, antialias=True)
        x = x.round().clamp(0, 255) / 255
        mean, std = (torch.tensor(v, device=device).view(1, 3, 1, 1) for v in (self.mean, self.std))
        return (x - mean) / std

    def points(self, xy: Sequence[Sequence[float]], image: Image, device: Any) -> Any:
        """Image points (N, 2) as the network counts them, float32."""
        import torch

        rows, columns = image.data.shape[:2]
        scale = torch.tensor([self.side / columns, self.side / rows], device=device)
        return torch.tensor(xy, dtype=torch.float32, device=device).view(-1, 2) * scale


def to_image(maps: Any, image: Image) -> Any:
    """Maps (N, h, w) of any resolution stretched over the image: (N, H, W), float32, bilinear."""
    import torch

    size = tuple(image.data.shape[:2])
    return torch.nn.functional.interpolate(maps[None].float(), size, mode="bilinear", align_corners=False)[0]


def to_array(tensor: Any) -> Array:
    """A tensor as a numpy array."""
    return np.asarray(tensor.detach().cpu().numpy())


def to_boxes(corners: Any, image: Image) -> list[BoundingBox2D]:
    """Boxes (N, 4) as x0, y0, x1, y1 [px], cut at the image's border."""
    rows, columns = image.data.shape[:2]
    cut = np.clip(to_array(corners.double()), 0, (columns, rows, columns, rows))
    return [BoundingBox2D(*map(float, box)) for box in cut]


def bounds(mask: Array) -> BoundingBox2D:
    """The smallest box around a mask; (0, 0, 0, 0) around an empty one."""
    ys, xs = np.nonzero(mask)
    if not len(xs):
        return BoundingBox2D(0.0, 0.0, 0.0, 0.0)
    return BoundingBox2D(float(xs.min()), float(ys.min()), float(xs.max()) + 1, float(ys.max()) + 1)


def check_image(image: Image) -> None:
    """Raises `BadRequestError` (`empty_image`) for an image without pixels."""
    if 0 in image.data.shape:
        raise BadRequestError("empty_image", f"The image has shape {image.data.shape}: no pixels.")
