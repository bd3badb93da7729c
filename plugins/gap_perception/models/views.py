"""What one image shows, as candidates a phrase can mean: the bridge from scene analysis to tools that get an image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gap_catalogue.shared.frames import find
from gap_perception.language.vocabulary import Vocabulary
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, BoundingBox2D, Image

MIN_SIDE, MAX_SIDE = 8, 8192  # px
_MIN_PART = 25  # px: less of an object in a crop is not worth a detection


@dataclass(frozen=True)
class Candidate:
    """One segment of an image: its `mask` (H, W), `box` (x_min, y_min, x_max, y_max; max exclusive), and `scores`, the
    probability of being each named model. With depth also its median `depth` [m], `center` in the world (3,) [m], and
    `size` of its points in the world (3,) [m]."""

    mask: Array
    box: tuple[int, int, int, int]
    scores: Mapping[str, float]
    depth: float = float("nan")
    center: Array | None = None
    size: Array = field(default_factory=lambda: np.zeros(3))
    instance: int = -1

    @property
    def bounds(self) -> BoundingBox2D:
        """The box as the contract writes it."""
        return BoundingBox2D(*(float(v) for v in self.box))

    def score(self, names: Mapping[str, float]) -> float:
        """Probability that it is one of the models, each weighed by how sure the phrase means it."""
        most = max(names.values(), default=1.0)
        return float(min(1.0, sum(sure / most * self.scores.get(name, 0.0) for name, sure in names.items())))


@dataclass(frozen=True)
class ImageView:
    """The candidates of one image, the vocabulary to name them in, and whether depth stood behind them."""

    image: Image
    candidates: tuple[Candidate, ...]
    vocabulary: Vocabulary
    has_depth: bool


def see(ctx: ToolContext, image: Image) -> ImageView:
    """Look at an image: with its depth when it is (cut from) a frame observed in this episode, else by colour alone.

    Raises `BadRequestError` for an image too small or too large to look at.
    """
    from gap_perception.scene.analyse import analyse, has_depth, library_of, vocabulary_of

    rows, columns = image.data.shape[:2]
    if min(rows, columns) < MIN_SIDE or max(rows, columns) > MAX_SIDE:
        raise BadRequestError(
            "image_size", f"The image is {columns}x{rows} pixels; sides of {MIN_SIDE} to {MAX_SIDE} can be looked at."
        )
    vocabulary = vocabulary_of(ctx)
    found = find(ctx.state, image)
    if found is None or not has_depth(found.scene, found.camera_index):
        from gap_perception.scene.appearance import look

        return ImageView(image, tuple(look(image, library_of(ctx))), vocabulary, has_depth=False)
    analysis = analyse(ctx, found.scene)
    x, y = found.offset
    candidates = []
    for index, instance in enumerate(analysis.instances):
        region = analysis.region(index, found.camera_index)
        mask = None if region is None else region.mask[y : y + rows, x : x + columns]
        if region is None or mask is None or np.count_nonzero(mask) < _MIN_PART:
            continue
        candidates.append(
            Candidate(
                mask, box_of(mask), instance.scores, region.depth, analysis.centers[index], analysis.sizes[index], index
            )
        )
    return ImageView(image, tuple(candidates), vocabulary, has_depth=True)


def box_of(mask: Array) -> tuple[int, int, int, int]:
    """Smallest box around a non-empty mask (x_min, y_min, x_max, y_max; max exclusive)."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
