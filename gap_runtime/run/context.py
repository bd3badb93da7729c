"""Executes one node, and what it may reach while it runs: `NodeContext` is the context of tools and scripts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

from gap_runtime.contracts.access import enter_node, leave_node
from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.failures import (
    BadRequestError,
    CancelledError,
    GapError,
    MotionError,
    PrivilegedReadError,
    ToolError,
    UnknownNameError,
    did_you_mean,
)
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer, require_renderer
from gap_runtime.graph.compiled import BoundCallable
from gap_runtime.graph.values import copy_containers, require_finite
from gap_runtime.run.attempt import DEADLINE, Attempt, deadline_error
from gap_runtime.run.guard import guarded_cell
from gap_runtime.run.services import Services


class NodeContext:
    """Handed to tools and scripts as `ctx`. `allowed` are the tools this code may call."""

    __slots__ = ("_allowed", "_attempt", "_cell", "_services")

    def __init__(self, services: Services, attempt: Attempt, allowed: frozenset[str]) -> None:
        self._services, self._attempt, self._allowed = services, attempt, allowed
        self._cell: Cell | None = None

    @property
    def cell(self) -> Cell:
        """The cell, as far as this node may touch it. Raises `ToolError` code `no_cell` in a run without one."""
        if self._services.cell is None:
            raise ToolError("no_cell", "This run has no cell.", hint="Run it with one, or with --dry.")
        self._attempt.reads_cell = True
        if self._cell is None:
            self._cell = guarded_cell(self._services.cell, self._attempt, self._services.leases)
        return self._cell

    @property
    def task(self) -> Task:
        """The task. Raises `ToolError` code `no_task` in a run without one."""
        if self._services.task is None:
            raise ToolError("no_task", "This run has no task.")
        return self._services.task

    @property
    def state(self) -> dict[str, Any]:
        """Per-episode memory of stateful providers."""
        return self._services.state

    @property
    def seed(self) -> int:
        """The episode's seed."""
        return self._services.seed

    @property
    def renderer(self) -> ObjectRenderer:
        """Renders object models. Raises `ToolError` code `no_renderer`."""
        return require_renderer(self._services.renderer)

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm. Raises `UnknownNameError`."""
        robots = self._services.robots
        if not 0 <= arm_id < len(robots):
            raise UnknownNameError("arm", str(arm_id), map(str, range(len(robots))))
        return robots[arm_id]

    def shared(self, key: str, make: Callable[[], Any]) -> Any:
        """Something immutable derived from models alone, made once per process."""
        return self._services.shared.get(key, make)

    def raise_if_cancelled(self) -> None:
        """Raise `CancelledError` (told to stop) or `ToolError` code `deadline`; call it in long loops."""
        self._attempt.check()

    def seconds_left(self) -> float:
        """Wall seconds until this node's deadline."""
        return self._attempt.deadline - monotonic()

    def publish(self, value: Any) -> None:
        """Make `value` the latest of this streaming node. Raises `BadRequestError` in any other node."""
        self._attempt.check()
        stream = self._attempt.activation.streams.get(self._attempt.node.index)
        if not self._attempt.node.streaming or stream is None:
            raise BadRequestError("stream", f"{self._attempt.node.path} is not a streaming node")
        callee = self._attempt.node.callee
        stream.publish(callee.check_result(value, self._attempt.node.path) if callee else value)

    @contextmanager
    def cleanup(self) -> Iterator[None]:
        """Let a node that was told to stop call tools that move nothing, to free what it holds."""
        self._attempt.in_cleanup = True
        try:
            yield
        finally:
            self._attempt.in_cleanup = False

    def tool(self, name: str, /, **inputs: Any) -> Any:
        """Call a tool the skill may use; returns its bare value or a NamedTuple.

        Raises `ToolError` (what the tool says, or code `allow_list`, `lease`, `deadline`), `BadRequestError`,
        `PrivilegedReadError`, `CancelledError`.
        """
        callee = self._permitted(name)
        return call(self._services, self._attempt, callee, inputs)

    def run_jailed(self, file: Path, inputs: dict[str, Any]) -> Any:
        """Run untrusted code in the jail, its tool calls served here one by one."""
        runner = self._services.script_runner
        if runner is None:
            raise GapError(f"{self._attempt.node.path} runs an inline script, and there is no jail to run it in.")
        return runner(
            file,
            inputs,
            lambda name, given: self.tool(name, **given),
            self.seconds_left(),
            publish=self.publish if self._attempt.node.streaming else None,
            check=self.raise_if_cancelled,
            robot=self.robot,
            seed=self._services.seed,
        )

    def _permitted(self, name: str) -> BoundCallable:
        callee = self._services.callees.get(name) or self._services.callees.get(name.replace("_", "-"))
        if callee is None:
            raise UnknownNameError("tool", name, self._allowed)
        if callee.privileged:
            raise PrivilegedReadError(
                f"Node {self._attempt.node.path!r} called {name}, which reads what only the simulator knows."
            )
        if callee.name not in self._allowed:
            raise ToolError(
                "allow_list", f"{self._attempt.node.path} may not call {name}.", hint=did_you_mean(name, self._allowed)
            )
        return callee


def execute_node(services: Services, attempt: Attempt) -> bool:
    """Run the attempt to its end. False when it was abandoned meanwhile, and nothing it did counts."""
    node = attempt.node
    value: Any = None
    error: BaseException | None = None
    attempt.begin(services.patience)
    token = enter_node(node.path)
    try:
        if attempt.cancelled:
            attempt.check()
        callee = node.callee
        if callee is not None:
            kwargs = attempt.inputs = inputs_of(attempt, callee)
            if callee.effect != "pure":
                claim(services, attempt, callee, kwargs)
            if services.record_calls:
                attempt.calls = []
            context = NodeContext(services, attempt, callee.allowed) if callee.takes_context else None
            value = callee.check_result(callee.invoke(context, kwargs), node.path)
            if attempt.cancelled:
                attempt.check()  # it went on after it was told to stop: what it returns does not count
    except BaseException as problem:  # a node may raise anything, SystemExit included
        error, value = problem, None
        if attempt.cancelled == DEADLINE:  # whatever it said while it was being stopped
            error = deadline_error(attempt)
            error.__cause__ = problem
        elif attempt.cancelled and isinstance(problem, MotionError) and problem.code == "stopped":
            error = CancelledError(f"{attempt.path} was told to stop: {attempt.cancelled.rstrip('.')}.")
            error.__cause__ = problem
    finally:
        leave_node(token)
    return attempt.complete(services.completing, value, error)


def inputs_of(attempt: Attempt, callee: BoundCallable) -> dict[str, Any]:
    """The node's inputs as its callee wants them. Raises `BadRequestError`, or what a stream has to say."""
    node = attempt.node
    kwargs = {name: copy_containers(value) for name, value in node.constants.items()} if node.constants else {}
    for name, read, check in node.readers:
        where = f"{node.path}.{name}"
        kwargs[name] = check(read(attempt.activation, attempt), where)
        require_finite(kwargs[name], where)
    if attempt.extra:
        kwargs |= checked(callee, {**kwargs, **attempt.extra}, node.path)
    elif callee.required:
        require_all(callee, kwargs, node.path)
    return kwargs


def call(services: Services, attempt: Attempt, callee: BoundCallable, inputs: Mapping[str, Any]) -> Any:
    """One tool call on behalf of a node: inputs checked, leases claimed, time bounded, output checked."""
    attempt.check()
    if attempt.in_cleanup and callee.effect == "actuate":
        raise ToolError(
            "cleanup", f"{attempt.node.path} calls {callee.name} while it cleans up; nothing may move then."
        )
    kwargs = checked(callee, inputs, callee.name)
    claim(services, attempt, callee, kwargs)
    outer = attempt.deadline, attempt.deadline_s, attempt.cell_deadline, attempt.tool
    _narrow(services, attempt, callee)
    start = monotonic()
    outcome: dict[str, Any] = {}
    try:
        context = NodeContext(services, attempt, callee.allowed)
        value = callee.check_result(callee.invoke(context, kwargs), callee.name)
        outcome = {"output": value}
        return value
    except BaseException as error:
        outcome = {"error": error}
        raise
    finally:
        attempt.deadline, attempt.deadline_s, attempt.cell_deadline, attempt.tool = outer
        if attempt.calls is not None:
            data = {"tool": callee.name, "inputs": kwargs, "duration_s": monotonic() - start, **outcome}
            attempt.calls.append((callee.name, start, data))


def checked(callee: BoundCallable, inputs: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The inputs as the callee wants them. Raises `BadRequestError`: unknown, missing, of another type, not finite."""
    kwargs: dict[str, Any] = {}
    for name, value in inputs.items():
        check = callee.checks.get(name)
        if check is None:
            known = [p.name for p in callee.arguments]
            raise BadRequestError("unknown_key", f"{where} has no input {name!r}", hint=did_you_mean(name, known))
        place = f"{where}.{name}"
        kwargs[name] = check(value, place)
        require_finite(kwargs[name], place)
    require_all(callee, kwargs, where)
    return kwargs


def require_all(callee: BoundCallable, kwargs: Mapping[str, Any], where: str) -> None:
    """Raise `BadRequestError` where an input without a default is missing."""
    missing = sorted(callee.required - kwargs.keys())
    if missing:
        raise BadRequestError("missing", f"{where} needs the input {missing[0]!r}")


def claim(services: Services, attempt: Attempt, callee: BoundCallable, kwargs: Mapping[str, Any]) -> None:
    """Hold what the call needs until the node has ended. Raises `ToolError` code `lease`."""
    if callee.effect == "pure" or callee.kind == "script":
        return
    moves = callee.effect == "actuate"
    if moves and attempt.node.effect != "actuate":
        raise ToolError(
            "lease",
            f"{attempt.node.path} calls {callee.name}, which moves the robot, under a computed name.",
            hint='Write the name out: ctx.tool("service.Method").',
        )
    if not (attempt.node.streaming and not moves):
        services.leases.claim(attempt, _resources(callee, kwargs), moves=moves)


def _resources(callee: BoundCallable, kwargs: Mapping[str, Any]) -> Iterable[str]:
    if not any("{" in r for r in callee.resources):
        return callee.resources
    known = {p.name: p.default for p in callee.arguments} | dict(kwargs)
    return [r.format(**known) for r in callee.resources]


def _narrow(services: Services, attempt: Attempt, callee: BoundCallable) -> None:
    """Let the tool's own deadline count while it runs, where it is the nearer one."""
    deadline = monotonic() + callee.deadline_s * services.patience
    if deadline < attempt.deadline:
        attempt.deadline, attempt.deadline_s, attempt.tool = deadline, callee.deadline_s, callee.name
    if services.cell is not None and callee.effect != "pure":
        now = services.cell.time
        if attempt.cell_deadline == math.inf and not attempt.node.streaming:
            attempt.cell_deadline = now + attempt.node.deadline_s
        attempt.cell_deadline = min(attempt.cell_deadline, now + callee.deadline_s)
