"""Detection by phrases with Grounding DINO (Liu et al., 2023), `GroundingDinoForObjectDetection`."""

from __future__ import annotations

import numpy as np

from gap_hf.loading import network
from gap_hf.vision.pixels import to_array, to_boxes
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, Detection, Image


def ground(image: Image, phrases: list[str], threshold: float) -> list[Detection]:
    """Boxes whose likeliest word, among all words of the phrases, is above `threshold`; that word's phrase labels it.

    Raises `BadRequestError` (`prompt`) when the phrases have more tokens than the network reads.
    """
    loaded = network("grounding_dino", "GroundingDinoForObjectDetection", "AutoProcessor")
    prompt = ". ".join(phrases).lower() + "."
    owner = assign_phrases(loaded.processor.tokenizer, prompt, phrases)
    limit = loaded.model.config.max_text_len
    if len(owner) > limit:
        raise BadRequestError(
            "prompt", f"The prompt has {len(owner)} tokens; {limit} are read.", hint="Ask in several calls."
        )
    inputs = loaded.processor(images=np.array(image.data), text=prompt, return_tensors="pt")
    with loaded.running() as model:
        found = model(**loaded.tensors(inputs))
        chances = to_array(found.logits[0, :, : len(owner)].float().sigmoid())
        centred = found.pred_boxes[0].float()
    chances = np.where(owner >= 0, chances, 0.0)  # full stops and special tokens are no words
    best = chances.argmax(axis=1)
    scores = chances.max(axis=1)
    rows, columns = image.data.shape[:2]
    half = centred[:, 2:] / 2
    corners = centred.new_zeros(len(scores), 4)
    corners[:, :2], corners[:, 2:] = centred[:, :2] - half, centred[:, :2] + half
    boxes = to_boxes(corners * corners.new_tensor([columns, rows, columns, rows]), image)
    return [Detection(boxes[i], phrases[owner[best[i]]], float(scores[i])) for i in np.nonzero(scores > threshold)[0]]


def assign_phrases(tokenizer: object, prompt: str, phrases: list[str]) -> Array:
    """For each token of `prompt` ("a. b. c.") the index of its phrase; -1 for full stops and special tokens."""
    spans = tokenizer(prompt, return_offsets_mapping=True)["offset_mapping"]  # type: ignore[operator]
    starts = np.cumsum([0, *(len(p.lower()) + 2 for p in phrases)])
    owner = np.full(len(spans), -1)
    for token, (first, last) in enumerate(spans):
        phrase = int(np.searchsorted(starts, first, side="right")) - 1
        if last > first and phrase < len(phrases) and last <= starts[phrase + 1] - 2:
            owner[token] = phrase
    return owner
