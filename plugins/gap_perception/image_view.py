"""What one image shows, as candidates a phrase can mean, for tools that are given an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gap_catalogue.shared.frames import find
from gap_perception.candidates import Candidate, box_of
from gap_perception.language.vocabulary import Vocabulary
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Image

MIN_SIDE, MAX_SIDE = 8, 8192  # px
_MIN_PART = 25  # px: less of an object in a crop is not worth a detection


@dataclass(frozen=True)
class ImageView:
    """The candidates of one image, the vocabulary to name them in, and whether depth stood behind them."""

    image: Image
    candidates: tuple[Candidate, ...]
    vocabulary: Vocabulary
    has_depth: bool


def view_image(ctx: ToolContext, image: Image) -> ImageView:
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
        from gap_perception.scene.appearance import segment_by_appearance

        return ImageView(image, tuple(segment_by_appearance(image, library_of(ctx))), vocabulary, has_depth=False)
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
