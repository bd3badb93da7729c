"""A single execution of a node: its clock, its cancellation, and who may still decide how it ended."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from threading import Event, Lock
from time import monotonic
from types import MappingProxyType
from typing import Any, Protocol

from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.graph.compiled import ActivationValues, CompiledNode

DEADLINE = "deadline"


class Activation(ActivationValues, Protocol):
    """The pass through a subgraph that an attempt belongs to."""

    top: int  # index of its top-level node
    ends_run: bool  # a failure here ends the whole run
    streams: dict[int, Any]
    streamers: list[Attempt]

    @property
    def tolerant(self) -> bool:
        """True for a recovery: an error is recorded and the next node runs."""

    def commit(self, attempt: Attempt) -> None:
        """Take over the output and move on. Raises `ExecutionError` or `ToolError` where its routing leads nowhere."""

    def skip(self, attempt: Attempt) -> None:
        """Move on without an output."""


class State(Enum):
    """RUNNING until the node's own thread completes it or the supervisor abandons it, whichever comes first."""

    RUNNING = 0
    COMPLETED = 1
    ABANDONED = 2


RUNNING, COMPLETED, ABANDONED = State.RUNNING, State.COMPLETED, State.ABANDONED  # looked up once


class Attempt:
    """A node being run. A result that comes after the attempt was abandoned is dropped, by identity of this object.

    `deadline` is on the monotonic clock, `cell_deadline` on the cell's (set when the node first touches the cell);
    `deadline_s` is what the node, or the `tool` it is calling, was allowed.
    `cell_wall_s` is wall time spent inside the cell, so that the rest is what the robot would wait for computing.
    """

    # Defaults live on the class: most attempts change few of them, and thousands are made.
    started = ended = cancelled_at = cell_wall_s = 0.0
    deadline = cell_deadline = math.inf
    cancelled = tool = ""
    reads_cell = False  # looks at the cell by itself, which therefore cannot wait for it
    in_cleanup = False  # frees what it holds; it may look on until it is abandoned
    state = RUNNING
    value: Any = None
    error: BaseException | None = None
    inputs: Mapping[str, Any] = MappingProxyType({})
    extra: Mapping[str, Any] | None = None
    send: tuple[int, int] | None = None
    calls: list[tuple[str, float, dict[str, Any]]] | None = None
    finished: Event  # of a streaming node: its thread is over

    def __init__(self, number: int, node: CompiledNode, activation: Activation) -> None:
        self.id, self.node, self.activation = number, node, activation
        self.deadline_s = node.deadline_s

    def begin(self, patience: float) -> None:
        """Start its clock; waiting for a thread does not count."""
        self.started = monotonic()
        if not self.node.streaming:
            self.deadline = self.started + self.deadline_s * patience

    def cancel(self, why: str) -> None:
        """Ask the node to stop, if it still runs; the first reason given stays."""
        if not self.cancelled and self.state is RUNNING:
            self.cancelled_at = monotonic()
            self.cancelled = why

    def check(self) -> None:
        """Raise `CancelledError`, or `ToolError` code `deadline`, where the node must not go on."""
        if self.in_cleanup and self.cancelled and self.state is RUNNING:
            return
        if self.cancelled == DEADLINE:
            raise deadline_error(self)
        if self.cancelled or self.state is ABANDONED:
            raise CancelledError(f"{self.node.path} was told to stop: {self.cancelled.rstrip('.')}.")
        if monotonic() > self.deadline:
            if not self.tool:  # the node's own time is up; that of a tool it calls is for the node to deal with
                self.cancel(DEADLINE)
            raise deadline_error(self)

    def complete(self, lock: Lock, value: Any, error: BaseException | None) -> bool:
        """Record how it ended; False when it was abandoned before, and its result is dropped."""
        with lock:
            if self.state is not RUNNING:
                return False
            self.state = COMPLETED
        self.ended = monotonic()
        self.value, self.error = value, error
        return True

    def abandon(self, lock: Lock) -> bool:
        """Give up on it; False when it was complete before."""
        with lock:
            if self.state is not RUNNING:
                return False
            self.state = ABANDONED
        self.ended = monotonic()
        if self.cancelled == DEADLINE:
            self.error = deadline_error(self)
        else:
            self.error = CancelledError(
                f"{self.node.path} did not stop when told to ({self.cancelled}); it was abandoned."
            )
        return True

    @property
    def path(self) -> str:
        """Of its node."""
        return self.node.path

    @property
    def paces_cell(self) -> bool:
        """True while the cell may wait for this streaming node."""
        return self.state is RUNNING and not self.cancelled and not self.reads_cell

    @property
    def stopped(self) -> bool:
        """True when it ended because it was told to, for a reason that is not its own."""
        return self.error is not None and self.cancelled not in ("", DEADLINE)

    @property
    def compute_s(self) -> float:
        """Wall time it took outside the cell: what the robot would have waited for."""
        return max(0.0, self.ended - self.started - self.cell_wall_s) if self.started and self.ended else 0.0


def deadline_error(attempt: Attempt) -> ToolError:
    """The error of a node that ran out of time."""
    return ToolError(
        DEADLINE,
        f"{attempt.node.path} took longer than the {attempt.deadline_s:g} s of {attempt.tool or 'the node'}.",
        hint="" if attempt.tool else "Give the node a larger deadline_s if it is meant to take that long.",
    )
