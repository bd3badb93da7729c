"""Detection by queries with OWL-ViT (Minderer et al., 2022) and OWLv2 (2023)."""

from __future__ import annotations

import numpy as np

from gap_hf.loading import network
from gap_hf.vision.pixels import to_array, to_boxes
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Detection, Image


def owl_detect(image: Image, queries: list[str], threshold: float) -> list[Detection]:
    """Boxes whose likeliest query is above `threshold`, labelled with it.

    Raises `BadRequestError` (`prompt`) for a query of more tokens than the text encoder reads.
    """
    loaded = network("owlvit", "AutoModelForZeroShotObjectDetection", "AutoProcessor")
    limit = loaded.model.config.text_config.max_position_embeddings
    for query in queries:
        tokens = len(loaded.processor.tokenizer(query)["input_ids"])
        if tokens > limit:
            raise BadRequestError("prompt", f"The query {query[:60]!r} has {tokens} tokens; {limit} are read.")
    inputs = loaded.processor(images=np.array(image.data), text=[queries], return_tensors="pt")
    rows, columns = image.data.shape[:2]
    with loaded.running() as model:
        found = model(**loaded.tensors(inputs))
        (kept,) = loaded.processor.post_process_grounded_object_detection(
            found, threshold=threshold, target_sizes=[(rows, columns)]
        )
    boxes = to_boxes(kept["boxes"].float(), image)
    scores, labels = to_array(kept["scores"].double()), to_array(kept["labels"])
    return [
        Detection(box, queries[label], float(score)) for box, label, score in zip(boxes, labels, scores, strict=True)
    ]
