"""Every hook a plugin may implement. Each receives `register`, which stamps what it is given with the plugin's name."""

from __future__ import annotations

from typing import Any, Protocol

import pluggy

PROJECT = "gap"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


class Register(Protocol):
    """What the host hands to a hook. See each hook for the arguments it takes."""

    def __call__(self, *args: Any, **kwargs: Any) -> None:
        """Register one thing."""


@hookspec
def gap_register_skills(register: Register) -> None:
    """register(path): a skill directory, or a directory of skill directories."""


@hookspec
def gap_register_contracts(register: Register) -> None:
    """register(request): a `gap_runtime.contracts.tool.ToolRequest` class, a contract that providers may serve."""


@hookspec
def gap_register_tools(register: Register) -> None:
    """register(tool): a function decorated with `serves` or `tool` of `gap_runtime.contracts.tool`."""


@hookspec
def gap_register_cells(register: Register) -> None:
    """register(name, factory): factory(task, scene, robots) -> World, robots mapping model name to RobotSpec."""


@hookspec
def gap_register_renderers(register: Register) -> None:
    """register(name, function): a `contracts.task.rendering.ObjectRenderer`; tools find it as `ctx.renderer`."""


@hookspec
def gap_register_robots(register: Register) -> None:
    """register(spec): a `RobotSpec`; or register(name, factory) where building one costs something."""


@hookspec
def gap_register_tasks(register: Register) -> None:
    """register(path): a task directory holding task.yaml, or a directory of such directories."""


@hookspec
def gap_register_authors(register: Register) -> None:
    """register(name, factory): factory() -> `contracts.author.Author`, chosen with `gap plan --author NAME`."""


@hookspec
def gap_register_policies(register: Register) -> None:
    """register(name, factory): factory() -> `contracts.policy.Policy`, a provider of the tool `policy.Act`."""


@hookspec
def gap_register_engines(register: Register) -> None:
    """register(name, factory): where rehearsals run; factory(workers) -> `contracts.engine.Engine`."""


@hookspec
def gap_register_benchmarks(register: Register) -> None:
    """register(name, function): what `gap bench` can run; function(bench: BenchContext) -> BenchReport, both
    of contracts/bench.py."""


@hookspec
def gap_register_preparations(register: Register) -> None:
    """register(name, function): function(ctx) makes what the plugin's tools derive from the models alone, through
    `ctx.shared`; called once per process before the first episode, so that no cycle pays for it. `ctx` has `task`,
    `robot` and `shared` of a `ToolContext`, and no world."""


@hookspec
def gap_register_checks(register: Register) -> None:
    """register(name, function): what `gap doctor` asks of this machine, in a process of its own; function() returns a
    line saying what it found, or raises `GapError` with what to install."""
