"""Where a network computes and how precisely: half precision on a GPU, full precision for the coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from gap_hf.settings import DEVICE, wanted_device, wanted_dtype
from gap_runtime.contracts.failures import ToolError

EXACT = ("shared_image_embedding", "prompt_encoder", "box_head", "bbox_embed")
"""Parts of a network that read or write coordinates. bfloat16 has 8 significant bits: a box edge at 1000 px would be
off by up to 4 px, so these small parts stay in float32."""


@dataclass(frozen=True)
class ComputeDevice:
    """A torch device and the dtype it computes in."""

    device: Any
    dtype: Any


def compute_device() -> ComputeDevice:
    """The GPU in bfloat16 (float16 where it has none), else the CPU in float32; the environment may say otherwise.

    Raises `ToolError` (`setting`) for a device that is not there.
    """
    import torch

    name = wanted_device() or ("cuda" if torch.cuda.is_available() else "cpu")
    try:
        device = torch.device(name)
    except RuntimeError:
        raise ToolError(
            "setting", f"{DEVICE} is {name!r}, which is no torch device.", hint="Try cuda or cpu."
        ) from None
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise ToolError(
            "setting",
            f"{DEVICE} is {name!r}; this torch sees {torch.cuda.device_count()} CUDA devices.",
            hint="Try cpu.",
        )
    chosen = wanted_dtype()
    if chosen:
        return ComputeDevice(device, getattr(torch, chosen))
    if device.type != "cuda":
        return ComputeDevice(device, torch.float32)
    return ComputeDevice(device, torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float16)


@contextmanager
def computing(place: ComputeDevice) -> Iterator[None]:
    """Compute without gradients; in half precision where the placement says so, the weights staying as they are."""
    import torch

    half = place.dtype != torch.float32
    with torch.inference_mode(), torch.autocast(place.device.type, place.dtype, enabled=half):
        yield


def keep_exact(model: Any) -> None:
    """Make the coordinate parts of a network (`EXACT`) compute in float32 under `computing`."""
    for name, part in model.named_modules():
        if name.rpartition(".")[2] in EXACT and not name.startswith(tuple(f"{n}." for n in EXACT)):
            _in_float32(part)


def _in_float32(part: Any) -> None:
    import torch

    if isinstance(part, torch.nn.ModuleList):
        for each in part:
            _in_float32(each)
        return
    forward = part.forward

    def exact(*arguments: Any, **named: Any) -> Any:
        with torch.autocast(_device_type(part), enabled=False):
            return forward(*map(_full, arguments), **{name: _full(value) for name, value in named.items()})

    part.forward = exact


def _device_type(part: Any) -> str:
    return str(next((p.device.type for p in (*part.parameters(), *part.buffers())), "cpu"))


def _full(value: Any) -> Any:
    import torch

    return value.float() if isinstance(value, torch.Tensor) and value.is_floating_point() else value
