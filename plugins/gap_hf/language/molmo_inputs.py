"""Molmo 2's own preprocessing with plain torch in place of torchvision, which not every torch build has."""

from __future__ import annotations

from typing import Any


def processor(source: str) -> Any:
    """What turns a chat with images into Molmo 2's inputs, as configured beside the weights at `source`.

    Tiling, pooling and the prompt's layout are transformers'; only the pixel operations it takes from torchvision
    (resize, normalise) are done here. Videos are not handled.
    """
    from transformers import AutoTokenizer
    from transformers.models.molmo2.processing_molmo2 import Molmo2Processor

    class StillProcessor(Molmo2Processor):  # type: ignore[misc]
        def check_argument_for_proper_class(self, argument_name: str, argument: Any) -> Any:
            return type(argument)  # the library insists on its torchvision classes, and on a video processor

    local = {"local_files_only": True, "trust_remote_code": False}
    settings, _ = Molmo2Processor.get_processor_dict(source, local_files_only=True)
    layout = {name: value for name, value in settings.items() if name.endswith(("_col_tokens", "_start_token"))}
    tokenizer = AutoTokenizer.from_pretrained(source, **local)
    made = StillProcessor(_images().from_pretrained(source, local_files_only=True), None, tokenizer, **layout)
    made.chat_template = tokenizer.chat_template
    return made


def _images() -> Any:
    import torch
    from transformers.models.molmo2.image_processing_molmo2 import Molmo2ImageProcessor

    class PlainImages(Molmo2ImageProcessor):  # type: ignore[misc]
        def convert_to_rgb(self, image: Any, input_data_format: Any = None) -> Any:
            return image  # contract images are RGB

        def resize(self, image: Any, size: Any, resample: Any = None, antialias: bool = True, **_: Any) -> Any:
            return torch.nn.functional.interpolate(
                image.float(), (size.height, size.width), mode="bilinear", align_corners=False, antialias=antialias
            )

        def normalize(self, image: Any, mean: Any, std: Any, inplace: bool = False, **_: Any) -> Any:
            mean, std = (torch.as_tensor(v, device=image.device).view(-1, 1, 1) for v in (mean, std))
            return (image - mean) / std

    return PlainImages
