"""Runs one node on the current thread: inputs checked, leases claimed, the callable called, its output checked."""

from __future__ import annotations

from typing import Any

from gap_runtime.contracts.access import enter_node, leave_node
from gap_runtime.graph.compiled import BoundCallable
from gap_runtime.graph.values import copy_containers, require_finite
from gap_runtime.run.attempt import DEADLINE, Attempt, deadline_error
from gap_runtime.run.context import NodeContext, Services, checked, claim, require_all


def perform(services: Services, attempt: Attempt) -> bool:
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
            value = callee.check_result(callee.invoke(context, kwargs), node.path)  # type: ignore[arg-type]
            if attempt.cancelled:
                attempt.check()  # it went on after it was told to stop: what it returns does not count
    except BaseException as problem:  # a node may raise anything, SystemExit included
        error, value = problem, None
        if attempt.cancelled == DEADLINE:  # whatever it said while it was being stopped
            error = deadline_error(attempt)
            error.__cause__ = problem
    finally:
        leave_node(token)
    return attempt.settle(services.settling, value, error)


def inputs_of(attempt: Attempt, callee: BoundCallable) -> dict[str, Any]:
    """The node's inputs as its callee wants them. Raises `BadRequestError`, or what a stream has to say."""
    node = attempt.node
    kwargs = {name: copy_containers(value) for name, value in node.constants.items()} if node.constants else {}
    for name, read, check in node.readers:
        where = f"{node.path}.{name}"
        kwargs[name] = check(read(attempt.frame, attempt), where)
        require_finite(kwargs[name], where)
    if attempt.extra:
        kwargs |= checked(callee, {**kwargs, **attempt.extra}, node.path)
    elif callee.required:
        require_all(callee, kwargs, node.path)
    return kwargs
