"""Finds plugins, ours and anyone's, and gathers what they register. Nothing here runs at import."""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import pluggy

from gap_runtime import hookspecs
from gap_runtime.contracts.policy import policy_tool
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task.rendering import ObjectRenderer
from gap_runtime.contracts.tool import Tool, ToolSpec
from gap_runtime.errors import GapError, PluginError, UnknownNameError

GROUP = "gap"
FIRST_PARTY = (
    "gap_catalogue",
    "gap_mujoco",
    "gap_robots",
    "gap_motion",
    "gap_perception",
    "gap_geometry",
    "gap_grasps",
    "gap_hf",
    "gap_tasks",
    "gap_cli.author",
    "gap_cli.bench",
    "morsl",
)
ENTRY_KINDS = ("cells", "renderers", "robots", "authors", "policies", "engines", "benchmarks", "checks", "preparations")
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Plugin:
    """A loaded plugin and the distribution it came from."""

    name: str
    version: str
    module: Any = field(repr=False)


@dataclass(frozen=True)
class Entry:
    """A registered thing that is not a tool: its name, the object (factory, path, spec), and who brought it."""

    name: str
    value: Any
    plugin: str


@dataclass(frozen=True)
class LeftOut:
    """A skill or a task that cannot be read, with the plugin that brought it."""

    plugin: str
    error: GapError

    def __str__(self) -> str:
        text = f"{self.error.message.removesuffix('.')} (plugin {self.plugin!r})."
        return f"{text} {self.error.hint}".strip()


@dataclass
class Registry:
    """Everything the plugins offer. `broken` maps the name of a plugin left out to the reason."""

    plugins: dict[str, Plugin] = field(default_factory=dict)
    broken: dict[str, str] = field(default_factory=dict)
    contracts: dict[str, ToolSpec] = field(default_factory=dict)
    providers: dict[str, dict[str, Tool]] = field(default_factory=dict)
    choices: dict[str, str] = field(default_factory=dict)
    skill_paths: list[tuple[Path, str]] = field(default_factory=list)
    task_paths: list[tuple[Path, str]] = field(default_factory=list)
    cells: dict[str, Entry] = field(default_factory=dict)
    renderers: dict[str, Entry] = field(default_factory=dict)
    robots: dict[str, Entry] = field(default_factory=dict)
    authors: dict[str, Entry] = field(default_factory=dict)
    policies: dict[str, Entry] = field(default_factory=dict)
    engines: dict[str, Entry] = field(default_factory=dict)
    benchmarks: dict[str, Entry] = field(default_factory=dict)
    checks: dict[str, Entry] = field(default_factory=dict)
    preparations: dict[str, Entry] = field(default_factory=dict)

    @property
    def tools(self) -> dict[str, Tool]:
        """The tool that serves each name: the chosen provider, else `embedded`, else the first by name."""
        return {name: by[self._choice(name, by)] for name, by in sorted(self.providers.items())}

    def tool(self, name: str) -> Tool:
        """One tool. Raises `UnknownNameError` with the nearest name."""
        if name not in self.providers and name in self.contracts:
            raise PluginError(f"No installed plugin serves {name!r}.", hint="`gap tools list` shows what is served.")
        if name not in self.providers:
            raise UnknownNameError("tool", name, {n: tool.spec.summary for n, tool in self.tools.items()})
        return self.providers[name][self._choice(name, self.providers[name])]

    @property
    def renderer(self) -> ObjectRenderer | None:
        """What renders object models: the first by name; None where no plugin does."""
        return self.renderers[min(self.renderers)].value if self.renderers else None

    def robot(self, name: str) -> RobotSpec:
        """One robot's spec. Raises `UnknownNameError`."""
        if name not in self.robots:
            raise UnknownNameError("robot", name, self.robots)
        value = self.robots[name].value
        return value if isinstance(value, RobotSpec) else value()

    def choose(self, tool: str, provider: str) -> None:
        """Serve `tool` by `provider` from now on; of `service.*`, the names that it serves.

        Raises `UnknownNameError` for a name that is not there, and where the provider serves none of the names.
        """
        names = [n for n in self.providers if n == tool or (tool.endswith(".*") and n.startswith(tool[:-1]))]
        if not names:
            raise UnknownNameError("tool", tool, self.providers)
        served = [name for name in names if provider in self.providers[name]]
        if not served:
            known = {other for name in names for other in self.providers[name]}
            raise UnknownNameError(f"provider of {tool}", provider, known)
        self.choices.update(dict.fromkeys(served, provider))

    def _choice(self, name: str, by_provider: dict[str, Tool]) -> str:
        if name in self.choices:
            return self.choices[name]
        return "embedded" if "embedded" in by_provider else min(by_provider)


def make_plugin_manager() -> pluggy.PluginManager:
    """A fresh manager that knows the hooks and no plugin."""
    manager = pluggy.PluginManager(hookspecs.PROJECT)
    manager.add_hookspecs(hookspecs)
    return manager


def load_registry(
    first_party: Iterable[str] = FIRST_PARTY, *, entry_points: bool = True, only: Iterable[str] | None = None
) -> Registry:
    """Load the plugins and let each register. A broken one is named in `broken` and left out; a clash raises.

    Raises `PluginError` when two plugins register one name.
    """
    registry = Registry()
    for name, version, load in _candidates(tuple(first_party), entry_points):
        if only is not None and name not in only:
            continue
        try:
            module = _quietly(load)
            _register(registry, Plugin(name, version, module))
        except PluginError:
            raise
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin may raise anything at import, SystemExit included
            registry.broken[name] = _reason(error)
            log.warning("plugin %s left out: %s", name, registry.broken[name])
    return registry


def _candidates(first_party: tuple[str, ...], entry_points: bool) -> list[tuple[str, str, Callable[[], Any]]]:
    from gap_runtime import __version__

    found: list[tuple[str, str, Callable[[], Any]]] = [
        (name, __version__, partial(importlib.import_module, name)) for name in first_party
    ]
    seen = set(first_party)
    for point in sorted(metadata.entry_points(group=GROUP), key=lambda p: p.value) if entry_points else ():
        if point.value not in seen:
            seen.add(point.value)
            found.append((point.value, point.dist.version if point.dist else "", point.load))
    return found


def _quietly(load: Callable[[], Any]) -> Any:
    """Import with stdout and the working directory guarded: a chatty plugin must not break `--json`."""
    cwd = Path.cwd()
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        try:
            return load()
        finally:
            if Path.cwd() != cwd:
                os.chdir(cwd)
            for text in (out.getvalue(), err.getvalue()):
                if text.strip():
                    log.debug("printed at import: %s", text.strip())


def _reason(error: BaseException) -> str:
    if isinstance(error, GapError):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _register(registry: Registry, plugin: Plugin) -> None:
    """Run the plugin's hooks against a scratch registry, then merge: a half-registered plugin leaves nothing."""
    manager = make_plugin_manager()
    manager.register(plugin.module, plugin.name)
    try:
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        raise GapError(f"misspelled hook: {error}") from None
    scratch = Registry()
    with contextlib.redirect_stdout(io.StringIO()):
        manager.hook.gap_register_contracts(register=lambda r: _add_contract(scratch, r.contract, plugin.name))
        manager.hook.gap_register_tools(register=lambda tool: _add_tool(scratch, tool, plugin.name))
        for kind in ENTRY_KINDS:
            hook = getattr(manager.hook, f"gap_register_{kind}")
            hook(register=lambda *a, kind=kind: _add_entry(getattr(scratch, kind), kind[:-1], a, plugin.name))
        for name, policy in scratch.policies.items():
            _add_tool(scratch, policy_tool(name, policy.value), plugin.name)
        manager.hook.gap_register_skills(register=lambda path: scratch.skill_paths.append((Path(path), plugin.name)))
        manager.hook.gap_register_tasks(register=lambda path: scratch.task_paths.append((Path(path), plugin.name)))
    _merge(registry, scratch, plugin)


def _add_contract(registry: Registry, contract: ToolSpec, plugin: str) -> None:
    known = registry.contracts.setdefault(contract.name, contract)
    if known is not contract:
        raise PluginError(f"Plugin {plugin!r} registers the contract of {contract.name!r} a second time.")


def _add_tool(registry: Registry, tool: Any, plugin: str) -> None:
    if not isinstance(tool, Tool):
        raise GapError(f"register() was given {tool!r}, not a function decorated with @tool")
    by_provider = registry.providers.setdefault(tool.spec.name, {})
    if tool.provider in by_provider:
        raise PluginError(f"Plugin {plugin!r} registers tool {tool.spec.name!r} twice as provider {tool.provider!r}.")
    by_provider[tool.provider] = replace(tool, plugin=plugin)


def _add_entry(entries: dict[str, Entry], kind: str, arguments: tuple[Any, ...], plugin: str) -> None:
    name, value = arguments if len(arguments) == 2 else (arguments[0].name, arguments[0])
    if name in entries:
        raise PluginError(f"Plugin {plugin!r} registers {kind} {name!r} twice.")
    entries[name] = Entry(name, value, plugin)


def _merge(registry: Registry, new: Registry, plugin: Plugin) -> None:
    for contract in new.contracts.values():
        _add_contract(registry, contract, plugin.name)
    for name, by_provider in new.providers.items():
        for provider, tool in by_provider.items():
            _merge_tool(registry.providers.setdefault(name, {}), provider, tool)
    for kind in ENTRY_KINDS:
        ours, theirs = getattr(registry, kind), getattr(new, kind)
        for name, entry in theirs.items():
            if name in ours:
                raise PluginError(
                    f"Plugins {ours[name].plugin!r} and {entry.plugin!r} both register {kind[:-1]} {name!r}.",
                    hint="Uninstall one of them or rename one.",
                )
            ours[name] = entry
    registry.skill_paths += new.skill_paths
    registry.task_paths += new.task_paths
    registry.plugins[plugin.name] = plugin


def _merge_tool(known: dict[str, Tool], provider: str, tool: Tool) -> None:
    if provider in known:
        raise PluginError(
            f"Plugins {known[provider].plugin!r} and {tool.plugin!r} both serve {tool.spec.name!r} as {provider!r}.",
            hint="Uninstall one of them, or give one another provider name.",
        )
    for other in known.values():
        if other.spec.schema_hash != tool.spec.schema_hash:
            raise PluginError(
                f"Plugins {other.plugin!r} and {tool.plugin!r} disagree about the contract of {tool.spec.name!r}.",
                hint="Providers of one tool name share its inputs, outputs and effect.",
            )
    known[provider] = tool
