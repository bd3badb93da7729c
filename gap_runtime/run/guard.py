"""The cell as a node's tools see it: what is not declared is refused, and every command needs its lease."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from time import monotonic
from typing import Any, Protocol, cast

from gap_runtime.contracts.access import Access, declared
from gap_runtime.contracts.arm import Arm, Gripper
from gap_runtime.contracts.cell import Cell, LockstepCell
from gap_runtime.contracts.failures import MotionError, PrivilegedReadError, ToolError
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.run.attempt import Attempt, deadline_error
from gap_runtime.run.leases import Leases

_PARTS: Mapping[str, type] = {"arms": Arm, "gripper": Gripper}


class _AnyCell(Simulator, LockstepCell, Protocol):
    """Everything a contract says a cell may offer."""


def guarded_cell(cell: Cell, attempt: Attempt, leases: Leases) -> Cell:
    """The cell for one attempt. What a robot could not do (`reset`, `snapshot`) raises `PrivilegedReadError`."""
    if attempt.cell_deadline == math.inf and not attempt.node.streaming:
        attempt.cell_deadline = cell.time + attempt.deadline_s
    return cast(Cell, _wrap(cell, _AnyCell, Guard(cell, attempt, leases), {}))


class Guard:
    """Decides on every call into the cell on behalf of one attempt."""

    def __init__(self, cell: Cell, attempt: Attempt, leases: Leases) -> None:
        self._cell, self._attempt, self._leases = cell, attempt, leases

    @contextmanager
    def inside(self, resources: Sequence[str]) -> Iterator[None]:
        """Around a call into the cell: check before, measure, and check again after."""
        attempt = self._attempt
        attempt.check()
        for resource in resources:
            if not self._leases.holds(attempt, resource):
                raise ToolError(
                    "lease",
                    f"{attempt.node.path} commands {resource} without holding it.",
                    hint="The tool must declare effect 'actuate' and this resource.",
                )
        start = monotonic()
        try:
            yield
        finally:
            attempt.cell_wall_s += monotonic() - start
        attempt.check()
        if self._cell.time > attempt.cell_deadline:
            raise deadline_error(attempt)

    def privileged(self, what: str) -> PrivilegedReadError:
        """The error of a call that no node may make."""
        return PrivilegedReadError(
            f"Node {self._attempt.node.path!r} asked for {what}, which only the simulator's keeper may have.",
            hint="A policy sees cameras, joint states, gripper width and forces; use those.",
        )

    def undeclared(self, what: str) -> ToolError:
        """The error of a call that nobody vouches for."""
        return ToolError(
            "undeclared",
            f"{self._attempt.node.path} calls {what}, which does not say what it does.",
            hint='Declare it where it is defined: @access("sense"), or @access("actuate", "arm:{arm_id}").',
        )


class Guarded:
    """A cell, an arm or a gripper behind its guard. Subclasses, made for each class of these, hold what is declared."""

    __slots__ = ("_guard", "_own", "_target")

    def __init__(self, target: Any, guard: Guard, own: Mapping[str, Any]) -> None:
        self._target, self._guard, self._own = target, guard, own

    def __getattr__(self, name: str) -> Any:
        owner, missing = type(self._target).__name__, object()
        if name.startswith("_") or inspect.getattr_static(self._target, name, missing) is missing:
            raise AttributeError(f"{owner} has no {name!r}")
        raise self._guard.undeclared(f"{owner}.{name}")


def _wrap(target: Any, contract: type, guard: Guard, own: Mapping[str, Any]) -> Guarded:
    cls: Any = type(target)
    return _proxy(cls, contract)(target, guard, own)


@cache
def _proxy(cls: type, contract: type) -> type[Guarded]:
    """What stands for objects of `cls`: what their class declares, and the contract, whose declarations win."""
    table = {**declared(cls), **declared(contract)}
    members = {name: _member(name, access, contract, cls) for name, access in table.items()}
    return type(f"Guarded{cls.__name__}", (Guarded,), {"__slots__": (), **members})


def _member(name: str, access: Access, contract: type, cls: type) -> Any:
    if name in _PARTS and name in declared(contract):
        return property(lambda self: _part(self, name))
    if access.privileged:
        return property(lambda self: _refuse(self, name))
    if isinstance(getattr(contract, name, getattr(cls, name, None)), property):
        if access.effect == "pure":
            return property(lambda self: getattr(self._target, name))
        return property(lambda self: _run(self, access.resources, lambda: getattr(self._target, name)))
    if access.always:
        return lambda self, *args, **kwargs: getattr(self._target, name)(*args, **kwargs)
    return _method(name, access, getattr(contract, name, None) or getattr(cls, name))


def _method(name: str, access: Access, function: Callable[..., Any]) -> Callable[..., Any]:
    named = any("{" in r for r in access.resources)
    signature = inspect.signature(function)

    def method(self: Guarded, *args: Any, **kwargs: Any) -> Any:
        resources = access.resources
        if not hasattr(self._target, name):
            raise MotionError("unsupported", f"This {type(self._target).__name__} has no {name!r}.")
        if named:
            given = dict(signature.bind(self, *args, **kwargs).arguments)
            resources = tuple(r for template in resources for r in _resources(template, {**given, **self._own}))
        return _run(self, resources, lambda: getattr(self._target, name)(*args, **kwargs))

    return method


def _resources(template: str, given: Mapping[str, Any]) -> list[str]:
    """The resources that a template names: one for each key or item of an argument that has several."""
    kind, _, name = template.partition("{")
    if not name:
        return [template]
    value = given[name.rstrip("}")]
    several = isinstance(value, (Mapping, Sequence)) and not isinstance(value, str)
    return [f"{kind}{item}" for item in (sorted(value) if several else [value])]


def _run(self: Guarded, resources: Sequence[str], call: Callable[[], Any]) -> Any:
    with self._guard.inside(resources):
        return call()


def _part(self: Guarded, name: str) -> Any:
    contract = _PARTS[name]
    parts = getattr(self._target, name)
    if name == "arms":
        return tuple(_wrap(arm, contract, self._guard, {"arm_id": i}) for i, arm in enumerate(parts))
    return _wrap(parts, contract, self._guard, self._own)


def _refuse(self: Guarded, name: str) -> Any:
    raise self._guard.privileged(f"{type(self._target).__name__}.{name}")
