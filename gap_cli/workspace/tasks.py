"""Finds installed tasks by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gap_runtime.errors import DocumentError, PluginError, UnknownNameError

if TYPE_CHECKING:
    from gap_runtime.contracts.task import Installed, Task
    from gap_runtime.plugins import Registry


def find_tasks(registry: Registry) -> dict[str, Path]:
    """Folder of each installed task by its folder's name. Raises `PluginError` when two plugins bring one name."""
    found: dict[str, tuple[Path, str]] = {}
    for path, plugin in registry.task_paths:
        for folder in task_folders(path):
            name = folder.resolve().name
            if name in found and found[name][0].resolve() != folder.resolve():
                raise PluginError(
                    f"Plugins {found[name][1]!r} and {plugin!r} both bring a task {name!r}.",
                    hint="Uninstall one of them or rename one.",
                )
            found[name] = (folder, plugin)
    return {name: found[name][0] for name in sorted(found)}


def task_folders(path: Path) -> list[Path]:
    """The folders of tasks at a path: of a task.yaml, a folder that holds one, or a folder of such folders."""
    if path.is_file() or (path / "task.yaml").is_file():
        return [path if path.is_dir() else path.parent]
    return sorted(file.parent for file in path.glob("*/task.yaml"))


def open_task(registry: Registry, name: str, variant: str | None = None) -> Task:
    """The named task with its variant applied, checked against what is installed. Raises `UnknownNameError`,
    `DocumentError` with every problem."""
    tasks = find_tasks(registry)
    if name not in tasks:
        raise UnknownNameError("task", name, tasks)
    return read_task(registry, tasks[name], variant)


def read_task(registry: Registry, folder: Path, variant: str | None = None) -> Task:
    """The task in a folder with its variant applied. Raises as `open_task` does."""
    from gap_runtime.contracts.task import load_task

    return load_task(folder, variant, _installed(registry, folder))


def task_problems(registry: Registry, folder: Path) -> list[str]:
    """What is wrong with the task in a folder, in any of its variants; what all of them share is named once."""
    from gap_runtime.contracts.task.load import TaskFile

    found: dict[str, list[str]] = {}
    variants = [""]
    try:
        file = TaskFile.read(folder)
        variants = list(file.variants) or variants
        for variant in variants:
            try:
                file.task(variant, _installed(registry, folder))
            except DocumentError as error:
                for problem in error.problems:
                    found.setdefault(problem, []).append(variant)
    except DocumentError as error:
        return [str(error)]
    return [p if len(bad) == len(variants) else f"variant {', '.join(bad)}: {p}" for p, bad in found.items()]


def _installed(registry: Registry, folder: Path) -> Installed:
    from gap_runtime.contracts.task import Installed

    return Installed(folder.resolve().name, registry.cells, registry.robot)
