"""Segmentation of everything a phrase names: the detector half of SAM 3 (`Sam3Model`)."""

from __future__ import annotations

from typing import NamedTuple

from gap_hf.loading import Network, network
from gap_hf.vision.pixels import HALVES, Square, to_array, to_boxes, to_image
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, BoundingBox2D, Image

TOKENS = 32  # the text encoder reads no more
FOUND = 0.5  # score from which an instance is reported, as in the reference implementation
INSIDE = 0.5  # probability from which a pixel belongs to an instance


class ConceptInstance(NamedTuple):
    """One thing the phrase names: how sure, its mask of the image's size, its box."""

    score: float
    mask: Array
    box: BoundingBox2D


def load() -> Network:
    """The detector with its tokenizer. Raises what `loading.network` raises."""
    return network("sam3", "Sam3Model", "AutoTokenizer")


def instances(image: Image, phrase: str, threshold: float = FOUND) -> list[ConceptInstance]:
    """What `phrase` names in the image, best first. Raises `BadRequestError` (`prompt`) for more than 32 tokens.

    The score is the query's probability times the probability that the concept is in the image at all.
    """
    loaded = load()
    text = loaded.processor(phrase, return_tensors="pt", padding="max_length", max_length=TOKENS)
    if text["input_ids"].shape[1] > TOKENS:
        raise BadRequestError("prompt", f"The phrase has more than {TOKENS} tokens: {phrase[:60]!r}...")
    with loaded.running() as model:
        side = model.config.vision_config.image_size
        square = Square(int(side if isinstance(side, int) else side[0]), *HALVES)
        found = model(
            pixel_values=square.pixels(image, loaded.place.device),
            **loaded.tensors({name: text[name] for name in ("input_ids", "attention_mask")}),
        )
        scores = (found.pred_logits.float().sigmoid() * found.presence_logits.float().sigmoid())[0]
        order = scores.argsort(descending=True, stable=True)
        order = order[scores[order] > threshold]
        rows, columns = image.data.shape[:2]
        boxes = found.pred_boxes[0, order].float() * scores.new_tensor([columns, rows, columns, rows])
        masks = to_array(to_image(found.pred_masks[0, order].float().sigmoid(), image) > INSIDE) if len(order) else ()
        kept = to_array(scores[order].double())
    cut = to_boxes(boxes, image)
    return [ConceptInstance(float(s), m, b) for s, m, b in zip(kept, masks, cut, strict=True) if m.any()]
