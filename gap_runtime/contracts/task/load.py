"""Reads a task from its folder, with a named variant laid over it."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from gap_runtime.contracts.documents import read_yaml
from gap_runtime.contracts.failures import DocumentError, UnknownNameError, did_you_mean
from gap_runtime.contracts.task.document import Task


def load_task(path: Path, variant: str | None = None) -> Task:
    """Read `path`/task.yaml and lay the variant over it (default: the first one listed).

    A variant is a partial document: mappings merge key by key, anything else replaces; `extends` names another variant
    to lay under it. Raises `DocumentError`, `UnknownNameError`.
    """
    file = path / "task.yaml"
    data = read_yaml(file)
    if not isinstance(data, dict):
        raise DocumentError(str(file), "must be a mapping")
    variants = data.get("variants") or {}
    if not isinstance(variants, dict):
        raise DocumentError(str(file), "variants: must be a mapping")
    chosen = variant or next(iter(variants), "")
    if chosen and chosen not in variants:
        raise UnknownNameError("variant", chosen, variants)
    merged: dict[str, Any] = data
    for overlay in _overlays(variants, chosen, str(file)):
        merged = _merge(merged, overlay)
    return Task.load({**merged, "variant": chosen, "path": path}, str(file), {"folder": path})


def _overlays(variants: dict[str, Any], chosen: str, where: str) -> list[dict[str, Any]]:
    """The variant's overlay after those it extends, each without `extends`."""
    found: list[dict[str, Any]] = []
    seen: list[str] = []
    name: Any = chosen or None
    while name is not None:
        if name in seen:
            raise DocumentError(where, f"variants.{chosen}.extends: goes in circles: {' > '.join([*seen, name])}")
        if not isinstance(name, str) or name not in variants:
            key = f"variants.{seen[-1]}.extends"
            raise DocumentError(where, f"{key}: {name!r} is not a variant", hint=did_you_mean(str(name), variants))
        overlay = variants[name] or {}
        if not isinstance(overlay, dict):
            raise DocumentError(where, f"variants.{name}: must be a mapping")
        found.insert(0, {key: value for key, value in overlay.items() if key != "extends"})
        seen.append(name)
        name = overlay.get("extends")
    return found


def _merge(base: Any, overlay: Any) -> Any:
    if not isinstance(overlay, dict) or not isinstance(base, dict):
        return copy.deepcopy(overlay)
    out = dict(base)
    for key, value in overlay.items():
        out[key] = _merge(base.get(key), value) if key in base else copy.deepcopy(value)
    return out
