"""Which candidates a phrase means: score, place among others, relation to a reference, all as the image shows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gap_perception.candidates import Candidate
from gap_perception.image_view import ImageView
from gap_perception.language.phrases import Phrase
from gap_runtime.contracts.failures import PerceptionError

REFERENCE_SCORE = 0.3  # from which a candidate may serve as a reference
NEAR = 0.10  # m between centres beyond the objects' own half sizes
CLEAR = 0.5  # of the narrower half width: how far apart centres must be to be left or right of each other


def matches(view: ImageView, phrase: Phrase, threshold: float) -> list[tuple[float, Candidate]]:
    """Candidates that are what the phrase says, with their scores, best first."""
    scored = [(c.score(phrase.names), c) for c in view.candidates]
    good = [(s, c) for s, c in scored if s >= threshold]
    if phrase.relation and phrase.reference is not None:
        good = _related(view, good, phrase.relation, phrase.reference)
    if phrase.place and good:
        key, largest = PLACES[phrase.place]
        chosen = (max if largest else min)(good, key=lambda g: key(g[1]))
        good = [chosen]
    return sorted(good, key=lambda g: (-g[0], g[1].box))


def holds(relation: str, a: Candidate, b: Candidate) -> bool:
    """True when `a` stands in the relation to `b`.

    Raises `PerceptionError` where telling takes depth and there is none.
    """
    return RELATIONS[relation](a, b)


def _related(
    view: ImageView, good: list[tuple[float, Candidate]], relation: str, names: Mapping[str, float]
) -> list[tuple[float, Candidate]]:
    references = [c for c in view.candidates if c.score(names) >= REFERENCE_SCORE]
    if not references:
        return []
    reference = max(references, key=lambda c: (c.score(names), c.box))
    others = [g for g in good if g[1] is not reference]
    if relation in ("nearest", "farthest"):
        sign = 1 if relation == "nearest" else -1
        return sorted(others, key=lambda g: sign * distance(g[1], reference))[:1]
    return [g for g in others if holds(relation, g[1], reference)]


def distance(a: Candidate, b: Candidate) -> float:
    """Between centres: in the world [m] where depth is known, else in the image [px]."""
    if a.center is not None and b.center is not None:
        return float(np.linalg.norm((a.center - b.center)[:2]))
    return float(np.hypot(_x(a) - _x(b), _y(a) - _y(b)))


def _x(c: Candidate) -> float:
    return (c.box[0] + c.box[2]) / 2


def _y(c: Candidate) -> float:
    return (c.box[1] + c.box[3]) / 2


def _area(c: Candidate) -> float:
    return float(np.prod(np.sort(c.size)[1:])) if c.center is not None else float(np.count_nonzero(c.mask))


def _beside(a: Candidate, b: Candidate) -> float:
    """How far a is right of b, in units of the narrower one's half width."""
    half = min(a.box[2] - a.box[0], b.box[2] - b.box[0]) / 2
    return (_x(a) - _x(b)) / max(half, 1.0)


def _deeper(a: Candidate, b: Candidate) -> float:
    """How much farther from the camera a is than b [m]."""
    _need_depth(a, b)
    return a.depth - b.depth


def _center(c: Candidate) -> Sequence[float]:
    assert c.center is not None
    return [float(v) for v in c.center]


def _need_depth(*candidates: Candidate) -> None:
    if any(c.center is None for c in candidates):
        raise PerceptionError(
            "no_depth",
            "Telling in front from behind, or in from on, takes depth, which this image has none of.",
            hint="Ask about an image from observation.GetObservation.",
        )


def _over(a: Candidate, b: Candidate) -> bool:
    """a's centre lies within b's extent seen from above."""
    _need_depth(a, b)
    return all(abs(_center(a)[i] - _center(b)[i]) <= b.size[i] / 2 for i in range(2))


def _bottom(c: Candidate) -> float:
    return _center(c)[2] - float(c.size[2]) / 2


def _top(c: Candidate) -> float:
    return _center(c)[2] + float(c.size[2]) / 2


RELATIONS: Mapping[str, Callable[[Candidate, Candidate], bool]] = {
    "left": lambda a, b: _beside(a, b) < -CLEAR,
    "right": lambda a, b: _beside(a, b) > CLEAR,
    "front": lambda a, b: _deeper(a, b) < -0.02,
    "behind": lambda a, b: _deeper(a, b) > 0.02,
    "near": lambda a, b: (
        distance(a, b) < (NEAR + float(a.size[:2].max() + b.size[:2].max()) / 2 if a.center is not None else 120)
    ),
    "above": lambda a, b: _over(a, b) and _bottom(a) > _top(b) - 0.01,
    "below": lambda a, b: _over(b, a) and _bottom(b) > _top(a) - 0.01,
    "in": lambda a, b: _over(a, b) and _bottom(a) < _top(b) - 0.01 and _bottom(a) > _bottom(b) + 0.002,
    "on": lambda a, b: _over(a, b) and abs(_bottom(a) - _top(b)) < 0.015,
}
PLACES: Mapping[str, tuple[Callable[[Candidate], float], bool]] = {
    "leftmost": (_x, False),
    "rightmost": (_x, True),
    "frontmost": (lambda c: c.depth if c.center is not None else -c.box[3], False),
    "backmost": (lambda c: c.depth if c.center is not None else -c.box[3], True),
    "largest": (_area, True),
    "smallest": (_area, False),
    "tallest": (lambda c: _top(c) if c.center is not None else c.box[3] - c.box[1], True),
}
