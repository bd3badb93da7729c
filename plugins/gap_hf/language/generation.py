"""Asks Molmo 2: a chat turn with images in, its text out."""

from __future__ import annotations

from typing import Any

import numpy as np

from gap_hf.language.molmo_inputs import processor
from gap_hf.loading import Network, network
from gap_hf.vision.pixels import check_image
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Image

MAX_NEW_TOKENS = 512


def load() -> Network:
    """Molmo 2. Raises what `loading.network` raises."""
    return network("molmo", "Molmo2ForConditionalGeneration", processor, cast=True)


def reply(ctx: ToolContext, prompt: str, images: list[Image]) -> str:
    """The text Molmo 2 answers with, greedily decoded; stops when the node is told to."""
    for image in images:
        check_image(image)
    loaded = load()
    inputs = prepare(loaded, prompt, images)
    with loaded.running() as model:
        written = model.generate(
            **inputs, max_new_tokens=MAX_NEW_TOKENS, do_sample=False, stopping_criteria=[_watch(ctx)]
        )
    answer = written[0, inputs["input_ids"].shape[1] :]
    return str(loaded.processor.tokenizer.decode(answer, skip_special_tokens=True)).strip()


def prepare(loaded: Network, prompt: str, images: list[Image]) -> dict[str, Any]:
    """The model's inputs for one user turn: the images, then the prompt."""
    content = [*({"type": "image"} for _ in images), {"type": "text", "text": prompt}]
    text = loaded.processor.tokenizer.apply_chat_template(
        [{"role": "user", "content": content}], tokenize=False, add_generation_prompt=True
    )
    pixels = [np.array(image.data) for image in images]
    inputs = loaded.tensors(loaded.processor(images=pixels, text=text, return_tensors="pt"))
    inputs["pixel_values"] = inputs["pixel_values"].to(loaded.place.dtype)
    return inputs


def _watch(ctx: ToolContext) -> Any:
    """A stopping criterion that never stops by itself but lets the node be cancelled between two tokens."""
    import torch

    def watch(input_ids: Any, scores: Any, **_: Any) -> Any:
        ctx.raise_if_cancelled()
        return torch.zeros(len(input_ids), dtype=torch.bool, device=input_ids.device)

    return watch
