"""Loads networks once per process, from a folder or the local hub cache, never from the net in the middle of a node."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from gap_hf.device import ComputeDevice, compute_device, computing, keep_exact
from gap_hf.settings import WEIGHTS, example, source, variable
from gap_runtime.contracts.failures import GapError, ToolError

INSTALL = "pip install 'gap-cli[hf]'"
DEADLINE_S = 300.0  # of a tool here: its first call in a process reads gigabytes of weights
_LOADED: dict[tuple[str, ...], Network] = {}
_LOCK = threading.RLock()


@dataclass(frozen=True)
class Network:
    """A network in evaluation mode, what prepares its inputs (tokenizer or processor), and where it computes."""

    model: Any = field(repr=False)
    processor: Any = field(repr=False)
    place: ComputeDevice
    lock: Any = field(default_factory=threading.Lock, repr=False)

    @contextmanager
    def running(self) -> Iterator[Any]:
        """The model, one caller at a time, without gradients and in the placement's precision."""
        with self.lock, computing(self.place):
            yield self.model

    def tensors(self, inputs: Any) -> dict[str, Any]:
        """`inputs` on the network's device."""
        return {name: value.to(self.place.device) for name, value in inputs.items()}


def library() -> Any:
    """transformers. Raises `ToolError` (`extra`) where it is not installed."""
    try:
        import transformers
    except ImportError:
        raise ToolError("extra", "transformers is not installed.", hint=INSTALL) from None
    return transformers


def network(
    service: str, architecture: str, prepare: Callable[[str], Any] | str = "", *, cast: bool = False
) -> Network:
    """The `architecture` of transformers with the weights of `service`, loaded by the first call.

    `prepare` makes what prepares the inputs: a class name of transformers, or a function of the source. With `cast` the
    weights themselves are held in the placement's dtype (large language models); else they stay float32.
    Raises `ToolError`: `extra` (not installed), `weights` (absent, damaged, of another architecture), `setting`.
    """
    library()
    place, where = compute_device(), source(service)
    key = (service, architecture, where, str(place.device), str(place.dtype))
    with _LOCK:
        if key not in _LOADED:
            _LOADED[key] = _load(service, architecture, where, place, prepare, cast)
        return _LOADED[key]


def forget() -> None:
    """Free every loaded network."""
    with _LOCK:
        _LOADED.clear()


def _load(
    service: str, architecture: str, where: str, place: ComputeDevice, prepare: Callable[[str], Any] | str, cast: bool
) -> Network:
    import torch

    local = {"local_files_only": True, "trust_remote_code": False}
    with _quiet(), _as_tool_error(service, where):
        kind = library().AutoConfig.from_pretrained(where, **local).model_type
        if kind not in WEIGHTS[service].kinds:
            raise _wrong(service, where, f"holds a {kind} network, not {' or '.join(WEIGHTS[service].kinds)}")
        model, found = getattr(library(), architecture).from_pretrained(
            where, **local, dtype=place.dtype if cast else torch.float32, output_loading_info=True
        )
        lost = _without_twins(model, set(found["missing_keys"])) + sorted(str(k) for k in found["mismatched_keys"])
        if lost:  # transformers would go on with random numbers in their place
            raise _wrong(service, where, f"lacks {len(lost)} tensors of {architecture}, such as {lost[0]}")
        if isinstance(prepare, str):
            processor = getattr(library(), prepare).from_pretrained(where, **local) if prepare else None
        else:
            processor = prepare(where)
        model = model.to(place.device).eval()
    keep_exact(model)
    return Network(model, processor, place)


def _without_twins(model: Any, missing: set[str]) -> list[str]:
    """Missing tensors that cannot be had from a twin: SAM's two copies of one random projection of coordinates."""
    twins = [name for name, _ in model.named_buffers() if name.endswith(".positional_embedding")]
    given = [name for name in twins if name not in missing]
    if given and missing & set(twins):
        matrix = model.get_buffer(given[0])
        for name in missing & set(twins):
            model.get_buffer(name).copy_(matrix)
        missing = missing - set(twins)
    return sorted(missing)


def _wrong(service: str, where: str, problem: str) -> ToolError:
    return ToolError(
        "weights", f"The checkpoint {where} {problem}.", hint=f"Set {variable(service)}, say to {example(service)}."
    )


@contextmanager
def _as_tool_error(service: str, where: str) -> Iterator[None]:
    """Whatever the libraries say about weights they cannot load, in one sentence with what to do."""
    try:
        yield
    except GapError:
        raise
    except Exception as problem:  # OSError, ValueError, SafetensorError, ...: each library has its own
        first = next((line.strip() for line in str(problem).splitlines() if line.strip()), "")
        raise ToolError(
            "weights",
            f"The weights {where!r} of {service} cannot be loaded on this machine.",
            hint=f"Fetch them with `hf download {where}`, or set {variable(service)} to a folder or another name.",
            detail={"cause": f"{type(problem).__name__}: {first}"[:300]},
        ) from None


@contextmanager
def _quiet() -> Iterator[None]:
    """No progress bars and loading reports: what matters in them becomes an error."""
    logs = library().utils.logging
    level, bars = logs.get_verbosity(), logs.is_progress_bar_enabled()
    logs.set_verbosity_error()
    logs.disable_progress_bar()
    try:
        yield
    finally:
        logs.set_verbosity(level)
        if bars:
            logs.enable_progress_bar()
