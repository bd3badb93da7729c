"""What providers derive from the models alone is made before the first episode: set-up, not part of a cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer, require_renderer
from gap_runtime.plugins import Registry
from gap_runtime.run.services import SHARED


@dataclass(frozen=True)
class ModelContext:
    """The part of a `ToolContext` that is known before any world is: the task, its robots, and what is made of them."""

    task: Task
    robots: tuple[RobotSpec, ...]
    object_renderer: ObjectRenderer | None

    @property
    def renderer(self) -> ObjectRenderer:
        """Renders object models. Raises `ToolError`."""
        return require_renderer(self.object_renderer)

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""
        return self.robots[arm_id]

    def shared(self, key: str, make: Callable[[], Any]) -> Any:
        """The process's own store, where nodes will find it."""
        return SHARED.get(key, make)


def warm_up(registry: Registry, task: Task, used: frozenset[str]) -> None:
    """Run the preparations of every plugin that serves one of the tools `used`, in the order of their names."""
    plugins = {registry.tool(name).plugin for name in used}
    context = ModelContext(task, tuple(registry.robot(placement.model) for placement in task.robots), registry.renderer)
    for _, entry in sorted(registry.preparations.items()):
        if entry.plugin in plugins:
            entry.value(context)
