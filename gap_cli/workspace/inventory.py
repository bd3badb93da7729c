"""What is installed, as one run sees it: its choice of providers applied, its task opened, its skills read."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from gap_cli.skills import SkillLibrary, load_library
from gap_cli.workspace.lock import build_lock
from gap_cli.workspace.run_config import Asked
from gap_cli.workspace.tasks import open_task
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.plugins import Registry, load_registry


@dataclass(frozen=True)
class Inventory:
    """The registry for one question, and what follows from it on demand."""

    asked: Asked
    registry: Registry = field(repr=False)

    @classmethod
    def of(cls, asked: Asked) -> Inventory:
        """Load the plugins. Raises `UnknownNameError` for a provider that is not there, `PluginError` for a clash."""
        registry = load_registry()
        for tool, provider in asked.providers.items():
            registry.choose(tool, provider)
        return cls(asked, registry)

    @cached_property
    def task(self) -> Task:
        """The task with its variant. Raises `UnknownNameError`, `DocumentError`."""
        return open_task(self.registry, self.asked.task, self.asked.variant)

    @cached_property
    def library(self) -> SkillLibrary:
        """All skills. Raises `DocumentError`, `PluginError`."""
        return load_library(self.registry.skill_paths)

    @property
    def tools(self) -> dict[str, ToolSpec]:
        """The contract of every tool."""
        return {name: tool.spec for name, tool in self.registry.tools.items()}

    @property
    def robots(self) -> dict[str, RobotSpec]:
        """The specs of the task's robots by model name. Raises `UnknownNameError`."""
        return {placement.model: self.registry.robot(placement.model) for placement in self.task.robots}

    def lock(self, sandbox: str) -> dict[str, Any]:
        """The content of lock.json; `sandbox` says how untrusted code is confined here (`gap_cli.sandbox.level`)."""
        skills = {name: bundle.digest for name, bundle in self.library.items()}
        return build_lock(self.registry, self.task, skills, sandbox)
