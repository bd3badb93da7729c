"""A robot cell outside any graph: the tool context that benchmarks and other callers of tools work with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer, require_renderer
from gap_runtime.contracts.tool import Tool


@dataclass
class StandaloneContext:
    """A `ToolContext` over one world, and a script's context too: `tool` calls any of `tools`.

    `state` is an episode's: clear it, or make a new cell, at each reset. `made` outlives episodes.
    """

    cell: Simulator
    task: Task
    robots: Mapping[str, RobotSpec]
    tools: Mapping[str, Tool]
    seed: int = 0
    object_renderer: ObjectRenderer | None = None
    state: dict[str, Any] = field(default_factory=dict)
    made: dict[str, Any] = field(default_factory=dict)

    @property
    def renderer(self) -> ObjectRenderer:
        """Renders object models. Raises `ToolError`."""
        return require_renderer(self.object_renderer)

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""
        return self.robots[self.task.robots[arm_id].model]

    def shared(self, key: str, make: Callable[[], Any]) -> Any:
        """Made once for this cell."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def raise_if_cancelled(self) -> None:
        """Nobody cancels a cell without a graph."""

    def tool(self, name: str, /, **inputs: Any) -> Any:
        """Call a tool by its catalogue name; what it returns and raises is the tool's. Raises `UnknownNameError`."""
        if name not in self.tools:
            raise UnknownNameError("tool", name, self.tools)
        return self.tools[name](self, **inputs)
