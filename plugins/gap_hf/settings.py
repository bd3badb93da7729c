"""What the environment says: which weights serve a service, on which device, in which precision."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from gap_runtime.contracts.failures import ToolError

DEVICE, DTYPE = "GAP_HF_DEVICE", "GAP_HF_DTYPE"
DTYPES = ("float32", "bfloat16", "float16")


@dataclass(frozen=True)
class Weights:
    """The published checkpoint of a service, and the `model_type`s of configurations that can serve it."""

    default: str
    kinds: tuple[str, ...]


WEIGHTS = {
    "grounding_dino": Weights("IDEA-Research/grounding-dino-base", ("grounding-dino",)),
    "owlvit": Weights("google/owlv2-base-patch16-ensemble", ("owlvit", "owlv2")),
    "sam2": Weights("facebook/sam2.1-hiera-large", ("sam2", "sam2_video")),
    "sam3": Weights("facebook/sam3", ("sam3_video",)),
    "sam3_tracker": Weights("facebook/sam3", ("sam3_video",)),
    "molmo": Weights("allenai/Molmo2-8B", ("molmo2",)),
}


def variable(service: str) -> str:
    """The environment variable that names the weights of `service`."""
    return f"GAP_HF_{service.upper()}"


def source(service: str) -> str:
    """Hub name or local folder of the weights of `service`. Raises `ToolError` (`weights`) for a folder not there."""
    chosen = os.environ.get(variable(service), "").strip() or WEIGHTS[service].default
    if chosen.startswith(("/", "./", "../", "~")):
        folder = Path(chosen).expanduser()
        if not folder.is_dir():
            raise ToolError(
                "weights",
                f"{variable(service)} names {chosen}, which is not a folder on this machine.",
                hint=f"Set it to a folder that `save_pretrained` wrote, or to a hub name such as {example(service)}.",
            )
        return str(folder)
    return chosen


def example(service: str) -> str:
    """The published checkpoint of `service`."""
    return WEIGHTS[service].default


def wanted_device() -> str:
    """`cuda`, `cuda:1`, `cpu`; empty to take what is there."""
    return os.environ.get(DEVICE, "").strip()


def wanted_dtype() -> str:
    """One of `DTYPES`; empty to take what suits the device. Raises `ToolError` (`setting`) for anything else."""
    chosen = os.environ.get(DTYPE, "").strip()
    if chosen and chosen not in DTYPES:
        raise ToolError("setting", f"{DTYPE} is {chosen!r}.", hint=f"Choose one of {', '.join(DTYPES)}.")
    return chosen
