"""Runs research packages published as code: imported when used, quiet, seeded, one caller at a time."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gap_runtime.contracts.failures import GapError, ToolError

_LOADED: dict[tuple[str, ...], Any] = {}
_LOCK = threading.RLock()


def module(name: str, title: str, repository: str) -> Any:
    """A module of a published package. Raises `ToolError` (`extra`) where it, or what it needs, cannot be imported."""
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            return importlib.import_module(name)
    except Exception as problem:  # research code fails at import in many ways: a CUDA extension, a moved name
        raise ToolError(
            "extra",
            f"{title} cannot be imported: {name} is not installed, or something it needs is not.",
            hint=f"Install it from {repository} into this environment.",
            detail={"cause": f"{type(problem).__name__}: {problem}"[:300]},
        ) from None


def path(variable: str, title: str, *, folder: bool) -> Path:
    """The checkpoint that an environment variable names. Raises `ToolError` (`setting`, `weights`)."""
    chosen = os.environ.get(variable, "").strip()
    kind = "folder" if folder else "file"
    if not chosen:
        raise ToolError("setting", f"{variable} must name {title}'s checkpoint {kind}.")
    found = Path(chosen).expanduser()
    if not (found.is_dir() if folder else found.is_file()):
        raise ToolError("weights", f"{variable} names {chosen}, which is not a {kind} on this machine.")
    return found


def once(key: tuple[str, ...], make: Callable[[], Any]) -> Any:
    """What `make` made in the first call with this key."""
    with _LOCK:
        if key not in _LOADED:
            _LOADED[key] = make()
        return _LOADED[key]


def forget() -> None:
    """Free everything loaded."""
    with _LOCK:
        _LOADED.clear()


@contextlib.contextmanager
def running(title: str, seed: int) -> Iterator[None]:
    """Run package code: no gradients, no prints, global random numbers seeded and put back, errors made ours.

    Raises `ToolError` (`package`) for whatever it raises.
    """
    import torch

    with _LOCK, contextlib.redirect_stdout(io.StringIO()), torch.random.fork_rng(), torch.no_grad():
        state = np.random.get_state()
        np.random.seed(seed % 2**32)
        torch.manual_seed(seed)
        try:
            yield
        except GapError:
            raise
        except Exception as problem:
            raise ToolError(
                "package",
                f"{title} failed.",
                hint="Run its own demo with the same checkpoint on this machine first.",
                detail={"cause": f"{type(problem).__name__}: {problem}"[:300]},
            ) from None
        finally:
            np.random.set_state(state)
