"""What a policy node may reach: methods declare their effect and what they command, and privileged reads raise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar, Token
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Literal, TypeVar

from gap_runtime.contracts.failures import PrivilegedReadError

Effect = Literal["pure", "sense", "actuate"]
F = TypeVar("F", bound=Callable[..., Any])
_MARK = "__access__"
_running_node: ContextVar[str | None] = ContextVar("running_node", default=None)


@dataclass(frozen=True)
class Access:
    """`resources` must be leased by the node that calls. A `{name}` in them is an argument of the call (one resource
    for each of its keys or items, where it has several), or `{arm_id}`, the arm's own. A `privileged` method is out of
    reach of every node. One that is `always` allowed may be called by a node that was told to stop."""

    effect: Effect
    resources: tuple[str, ...] = ()
    privileged: bool = False
    always: bool = False


def access(effect: Effect, *resources: str, privileged: bool = False, always: bool = False) -> Callable[[F], F]:
    """Declare a method, or a property's getter, of a contract, or one that a plugin's class adds to it.

    `pure` reads a constant, `sense` a sensor, `actuate` commands. What is not declared cannot be called by a node.
    """

    def mark(method: F) -> F:
        setattr(method, _MARK, Access(effect, resources, privileged, always))
        return method

    return mark


@cache
def declared(cls: type) -> Mapping[str, Access]:
    """Every declared member of a class or Protocol, by name, its bases' included."""
    found: dict[str, Access] = {}
    for base in reversed(cls.__mro__):
        for name, member in vars(base).items():
            marked = getattr(member.fget if isinstance(member, property) else member, _MARK, None)
            if isinstance(marked, Access):
                found[name] = marked
    return MappingProxyType(found)


def enter_node(path: str) -> Token[str | None]:
    """Mark the current thread of execution as belonging to the policy node `path`; undo it with `leave_node`."""
    return _running_node.set(path)


def leave_node(token: Token[str | None]) -> None:
    """Undo the `enter_node` that gave `token`."""
    _running_node.reset(token)


@contextmanager
def node_scope(path: str) -> Iterator[None]:
    """`enter_node` and `leave_node` around a block."""
    token = enter_node(path)
    try:
        yield
    finally:
        leave_node(token)


def current_node() -> str | None:
    """Path of the node this code runs for, or None outside a policy."""
    return _running_node.get()


def assert_privileged(what: str) -> None:
    """Raise `PrivilegedReadError` when called on behalf of a policy node."""
    node = _running_node.get()
    if node is not None:
        raise PrivilegedReadError(
            f"Node {node!r} tried to read {what}, which only the simulator knows.",
            hint="A policy sees cameras, joint states, gripper width and forces; use those.",
        )
