"""What is installed, as one run sees it: its choice of providers applied, its task opened, its skills read."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from gap_cli.skills import SkillLibrary, load_library
from gap_cli.workspace.lock import build_lock
from gap_cli.workspace.run import RunConfig
from gap_cli.workspace.tasks import open_task
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.bundle.digest import BundleDigest
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import RunError
from gap_runtime.plugins import Registry, load_registry


@dataclass(frozen=True)
class Inventory:
    """The registry for one question, and what follows from it on demand."""

    config: RunConfig
    registry: Registry = field(repr=False)

    @classmethod
    def of(cls, config: RunConfig) -> Inventory:
        """Load the plugins. Raises `UnknownNameError` for a provider that is not there, `PluginError` for a clash."""
        registry = load_registry()
        for tool, provider in config.providers.items():
            registry.choose(tool, provider)
        return cls(config, registry)

    @cached_property
    def task(self) -> Task:
        """The task with its variant. Raises `UnknownNameError`, `DocumentError`, `RunError` where none was named."""
        if not self.config.task:
            raise RunError("Which task this graph is for is not known.", hint="Give it: --task NAME[:variant].")
        return open_task(self.registry, self.config.task, self.config.variant)

    @cached_property
    def library(self) -> SkillLibrary:
        """All skills, the run's own before the installed ones. Raises `PluginError`."""
        return load_library(self.registry.skill_paths, map(Path, self.config.skills))

    @property
    def tools(self) -> dict[str, ToolSpec]:
        """The contract of every tool."""
        return {name: tool.spec for name, tool in self.registry.tools.items()}

    @property
    def robots(self) -> dict[str, RobotSpec]:
        """The specs of the task's robots by model name. Raises `UnknownNameError`."""
        return {placement.model: self.registry.robot(placement.model) for placement in self.task.robots}

    def digest(self, bundle: GraphBundle) -> BundleDigest:
        """What the bundle holds, and the tools and skills installed here that it relies on."""
        return bundle.digest(self.tools, self.library.contracts, self._skill_digests)

    @cached_property
    def _skill_digests(self) -> dict[str, str]:
        return {name: skill.digest for name, skill in self.library.items()}

    def lock(self, sandbox: str) -> dict[str, Any]:
        """The content of lock.json; `sandbox` says how untrusted code is confined here (`gap_cli.sandbox.level`)."""
        task = self.task if self.config.task else None
        return build_lock(self.registry, task, self._skill_digests, sandbox)
