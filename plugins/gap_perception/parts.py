"""Parts of objects, found by where the object's model says they are: the handle of a pan, the rim of a mug."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from gap_catalogue.shared.frames import FoundFrame, find
from gap_perception.candidates import Candidate, box_of
from gap_perception.image_view import ImageView
from gap_perception.language.phrases import Phrase, read_phrase
from gap_perception.language.relations import matches
from gap_perception.language.vocabulary import Vocabulary
from gap_runtime.contracts.task import ObjectModel, Shape
from gap_runtime.contracts.task.container_geometry import body_centre
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, Image

RIM = 0.012  # m below the top that counts as the rim: what pads of a gripper hold it by
MIN_PIXELS = 12  # fewer of a part say nothing about where it is
PART_MARGIN = 0.002  # m around a declared part: a grid cell of what is seen
_ARTICLE = r"(?:the |a |an )?"


def named_parts(
    ctx: ToolContext, image: Image, view: ImageView, text: str, threshold: float
) -> list[tuple[float, Candidate]]:
    """What `text` names as a part of something, best first, as far as the image shows it: "handle of the frying pan",
    "the pan's handle", "mug rim", or "rim" of anything that has one. Scores are those of the whole objects."""
    asked = read_part(text, view.vocabulary, ctx.task.objects)
    source = find(ctx.state, image)
    if asked is None or source is None or not view.has_depth:
        return []
    part, whole = asked
    if whole is not None:
        wholes = matches(view, whole, threshold)
    else:
        wholes = sorted(((max(c.scores.values(), default=0.0), c) for c in view.candidates), key=lambda w: -w[0])
    shown = ((score, _shown(ctx, source, candidate, part)) for score, candidate in wholes if score >= threshold)
    return [(score, candidate) for score, candidate in shown if candidate is not None]


def read_part(
    text: str, vocabulary: Vocabulary, objects: Mapping[str, ObjectModel] = MappingProxyType({})
) -> tuple[str, Phrase | None] | None:
    """The part a text names, and the phrase for what it belongs to, None for anything; None for no part.

    Handles and rims have names of their own; other parts are those that the `objects` declare.
    """
    clean = " ".join(re.sub(r"[^a-z0-9' ]", " ", text.lower().replace("-", " ")).split())
    declared = {
        name: "|".join(re.escape(word.lower().replace("_", " ")) for word in (name, *part.words))
        for model in objects.values()
        for name, part in model.parts.items()
    }
    for part, words in {**declared, **_WORDS}.items():
        if re.fullmatch(rf"{_ARTICLE}(?:{words})", clean):
            return part, None
        for pattern in (rf"{_ARTICLE}(?:{words}) (?:of|on) (?P<whole>.+)", rf"(?P<whole>.+?)(?:'s?)? (?:{words})"):
            match = re.fullmatch(pattern, clean)
            whole = read_phrase(match["whole"], vocabulary) if match else None
            if whole is not None:
                return part, whole
    return None


def _shown(ctx: ToolContext, source: FoundFrame, whole: Candidate, part: str) -> Candidate | None:
    """What an image shows of the part of one object; None where its model has no such part, or too little shows."""
    from gap_perception.scene.analyse import analyse

    match = analyse(ctx, source.scene).instances[whole.instance].match
    inside = part_points(match.fit.surface.model, part) if match else None
    if match is None or inside is None:
        return None
    rows, columns, points = _pixels(ctx, source, whole)
    on_it = inside(match.fit.local(points))
    if np.count_nonzero(on_it) < MIN_PIXELS:
        return None
    mask = np.zeros_like(whole.mask)
    mask[rows[on_it], columns[on_it]] = True
    low, high = points[on_it].min(axis=0), points[on_it].max(axis=0)
    return Candidate(mask, box_of(mask), {}, whole.depth, (low + high) / 2, high - low)


def _pixels(ctx: ToolContext, source: FoundFrame, candidate: Candidate) -> tuple[Array, Array, Array]:
    """Rows and columns in the image, and world points (N, 3) [m], of what a candidate shows."""
    from gap_perception.scene.points import lift

    lifted, (x, y) = lift(source.camera, ctx.task.environment), source.offset
    rows, columns = lifted.rows - y, lifted.columns - x
    height, width = candidate.mask.shape
    mine = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    mine[mine] = candidate.mask[rows[mine], columns[mine]]
    return rows[mine], columns[mine], lifted.xyz[mine]


Inside = Callable[[Array], Array]  # which of the points (N, 3) [m] in the object's frame belong to the part


def part_points(model: ObjectModel, part: str) -> Inside | None:
    """Which points of an object belong to its part; None where its model has no such part."""
    if part not in model.parts:
        return INSIDE[part](model.shape) if part in INSIDE else None
    centre, half = np.array(model.parts[part].center), np.array(model.parts[part].size) / 2
    return lambda p: (np.abs(p - centre) <= half + PART_MARGIN).all(axis=1)


def _handle(shape: Shape) -> Inside | None:
    """What sticks out of the round body of a pan or a mug; it points along the object's x axis."""
    if shape.handle is None:
        return None
    centre, clear = body_centre(shape), (shape.size[1] + (shape.wall or 0.0)) / 2
    return lambda p: (p[:, 0] > centre) & (np.hypot(p[:, 0] - centre, p[:, 1]) > clear)


def _rim(shape: Shape) -> Inside | None:
    """The top of the wall of anything hollow."""
    if shape.wall is None:
        return None
    handle = _handle(shape)
    top = shape.size[2] / 2 - RIM
    return lambda p: (p[:, 2] > top) & ~(handle(p) if handle else np.zeros(len(p), dtype=bool))


_WORDS: Mapping[str, str] = {
    "handle": "handles?|grip|ear",
    "rim": "rim|brim|lip|upper edge|top edge",
}
INSIDE: Mapping[str, Callable[[Shape], Inside | None]] = {"handle": _handle, "rim": _rim}
