"""Reads a task from its folder, with a named variant laid over it."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gap_runtime.contracts.documents import read_yaml
from gap_runtime.contracts.failures import DocumentError, UnknownNameError, did_you_mean
from gap_runtime.contracts.task.document import Task
from gap_runtime.contracts.task.reading import Installed, Reading

FILE = "task.yaml"


def load_task(path: Path, variant: str | None = None, installed: Installed | None = None) -> Task:
    """Read `path`/task.yaml and lay the variant over it (default: the first one listed).

    With `installed` the task is also checked against the robots and the simulator it names. Raises
    `DocumentError` with every problem, `UnknownNameError`.
    """
    return TaskFile.read(path).task(variant, installed)


@dataclass(frozen=True)
class TaskFile:
    """The content of a folder's task.yaml. A variant is a partial document: mappings merge key by key, anything else
    replaces; `extends` names another variant to lay under it."""

    path: Path
    data: dict[str, Any]
    variants: dict[str, Any]

    @classmethod
    def read(cls, path: Path) -> TaskFile:
        """Raises `DocumentError`."""
        file = path / FILE
        data = read_yaml(file)
        if not isinstance(data, dict):
            raise DocumentError(str(file), "must be a mapping")
        variants = data.get("variants") or {}
        if not isinstance(variants, dict):
            raise DocumentError(str(file), "variants: must be a mapping")
        return cls(path, data, variants)

    def task(self, variant: str | None = None, installed: Installed | None = None) -> Task:
        """See `load_task`."""
        chosen = variant or next(iter(self.variants), "")
        if chosen and chosen not in self.variants:
            raise UnknownNameError("variant", chosen, self.variants)
        merged: dict[str, Any] = self.data
        where = str(self.path / FILE)
        for overlay in self._overlays(chosen, where):
            merged = _merge(merged, overlay)
        return Task.load({**merged, "variant": chosen, "path": self.path}, where, Reading(self.path, installed))

    def _overlays(self, chosen: str, where: str) -> list[dict[str, Any]]:
        """The variant's overlay after those it extends, each without `extends`."""
        found: list[dict[str, Any]] = []
        seen: list[str] = []
        name: Any = chosen or None
        while name is not None:
            if name in seen:
                raise DocumentError(where, f"variants.{chosen}.extends: goes in circles: {' > '.join([*seen, name])}")
            if not isinstance(name, str) or name not in self.variants:
                near = did_you_mean(str(name), self.variants)
                raise DocumentError(where, f"variants.{seen[-1]}.extends: {name!r} is not a variant. {near}")
            overlay = self.variants[name] or {}
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
