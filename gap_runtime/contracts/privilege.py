"""The guard between a policy and simulator ground truth: a privileged read inside a node raises."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar, Token

from gap_runtime.contracts.failures import PrivilegedReadError

_running_node: ContextVar[str | None] = ContextVar("running_node", default=None)


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
