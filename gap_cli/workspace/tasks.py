"""Finds installed tasks by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gap_runtime.errors import PluginError, UnknownNameError

if TYPE_CHECKING:
    from gap_runtime.contracts.task import Task
    from gap_runtime.plugins import Registry


def find_tasks(registry: Registry) -> dict[str, Path]:
    """Folder of each installed task by its folder's name. Raises `PluginError` when two plugins bring one name."""
    found: dict[str, tuple[Path, str]] = {}
    for path, plugin in registry.task_paths:
        for folder in [path] if (path / "task.yaml").is_file() else sorted(p.parent for p in path.glob("*/task.yaml")):
            name = folder.resolve().name
            if name in found and found[name][0].resolve() != folder.resolve():
                raise PluginError(
                    f"Plugins {found[name][1]!r} and {plugin!r} both bring a task {name!r}.",
                    hint="Uninstall one of them or rename one.",
                )
            found[name] = (folder, plugin)
    return {name: found[name][0] for name in sorted(found)}


def open_task(registry: Registry, name: str, variant: str | None = None) -> Task:
    """The named task with its variant applied. Raises `UnknownNameError`, `DocumentError`."""
    from gap_runtime.contracts.task import load_task

    tasks = find_tasks(registry)
    if name not in tasks:
        raise UnknownNameError("task", name, tasks)
    return load_task(tasks[name], variant or None)
