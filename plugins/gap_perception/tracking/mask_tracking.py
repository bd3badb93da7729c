"""Recognises one object again from frame to frame: by its probable names, by its colours, by where it was last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gap_perception.boxes import fill
from gap_perception.candidates import Candidate, box_of
from gap_perception.image_view import ImageView, view_image
from gap_perception.language.phrases import read_phrase
from gap_perception.language.relations import matches
from gap_perception.scene.colours import hue_histogram, overlap, perceptual
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, BoundingBox2D, Image, Mask

SURE = 0.5  # probability of a name from which an object is followed by that name
PRESENT = 0.2  # probability of being it from which it counts as there
ALIKE = 0.7  # overlap of hues from which something without a name counts as it
REACH = 0.15  # m: typical way between two frames, for choosing among look-alikes
REACH_PX = 80.0
NEARNESS = 0.3  # weight of where it was, against what it is


class Seen(NamedTuple):
    """What a tracker saw in one frame."""

    mask: Mask
    box: BoundingBox2D
    score: float
    present: bool


@dataclass(frozen=True)
class Track:
    """What is known of a followed object: `names` it may have, its `hues`, and where it was last."""

    names: Mapping[str, float]
    hues: Array | None = None
    center: Array | None = None
    middle: tuple[float, float] | None = None


def start(
    ctx: ToolContext, image: Image, text: str, box: BoundingBox2D | None, point: tuple[int, int] | None
) -> tuple[Track, Seen]:
    """A new track from a phrase, a box or a pixel of the image."""
    view = view_image(ctx, image)
    if text:
        phrase = read_phrase(text, view.vocabulary)
        found = matches(view, phrase, PRESENT) if phrase else []
        track = Track(dict(phrase.names) if phrase else {})
        return _updated(track, view, found[0][1], found[0][0]) if found else (track, _nothing(image))
    if point is not None:
        hits = [c for c in view.candidates if c.mask[point[1], point[0]]]
        chosen, score = (hits[0], 1.0) if hits else (None, 0.0)
    else:
        assert box is not None
        chosen, score = _in_box(ctx, image, view, box)
    if chosen is None:
        return Track({}), _nothing(image)
    names = {name: p for name, p in chosen.scores.items() if p >= SURE}
    return _updated(Track(names), view, chosen, score)


def follow(ctx: ToolContext, track: Track, image: Image) -> tuple[Track, Seen]:
    """The track after a new frame, and what was seen of it there."""
    view = view_image(ctx, image)
    rated = [(_identity(track, view, c), c) for c in view.candidates]
    enough = PRESENT if track.names else ALIKE
    rated = [(identity, c) for identity, c in rated if identity >= enough]
    if not rated:
        return track, _nothing(image)
    identity, best = max(rated, key=lambda r: (r[0] * (1 - NEARNESS + NEARNESS * _nearness(track, r[1])), r[1].box))
    return _updated(track, view, best, identity)


def _in_box(ctx: ToolContext, image: Image, view: ImageView, box: BoundingBox2D) -> tuple[Candidate | None, float]:
    filled = fill(ctx, image, box)
    if not filled:
        return None, 0.0
    score, mask = filled[0]
    known = [c for c in view.candidates if np.array_equal(c.mask, mask)]
    return (known[0] if known else Candidate(mask, box_of(mask), {})), score


def _identity(track: Track, view: ImageView, candidate: Candidate) -> float:
    """How probably a candidate is the tracked object, 0 to 1."""
    if track.names:
        return candidate.score(track.names)
    return overlap(track.hues, _hues(view, candidate)) if track.hues is not None else 0.0


def _nearness(track: Track, candidate: Candidate) -> float:
    if track.center is not None and candidate.center is not None:
        return float(np.exp(-np.linalg.norm(track.center - candidate.center) / REACH))
    if track.middle is None:
        return 1.0
    return float(np.exp(-np.hypot(*np.subtract(track.middle, _middle(candidate))) / REACH_PX))


def _updated(track: Track, view: ImageView, candidate: Candidate, score: float) -> tuple[Track, Seen]:
    moved = replace(
        track, hues=_hues(view, candidate), middle=_middle(candidate),
        center=candidate.center if candidate.center is not None else track.center,
    )  # fmt: skip
    return moved, Seen(Mask(candidate.mask), candidate.bounds, float(score), True)


def _hues(view: ImageView, candidate: Candidate) -> Array:
    return hue_histogram(perceptual(view.image.data[candidate.mask]))


def _middle(candidate: Candidate) -> tuple[float, float]:
    return (candidate.box[0] + candidate.box[2]) / 2, (candidate.box[1] + candidate.box[3]) / 2


def _nothing(image: Image) -> Seen:
    return Seen(Mask(np.zeros(image.data.shape[:2], dtype=bool)), BoundingBox2D(0.0, 0.0, 0.0, 0.0), 0.0, False)
