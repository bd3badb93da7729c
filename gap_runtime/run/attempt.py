"""One try at running one node: its clock, its cancellation, and who may still decide how it ended."""

from __future__ import annotations

import math
from enum import Enum
from threading import Event, Lock
from time import monotonic
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gap_runtime.contracts.failures import CancelledError, ToolError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gap_runtime.graph.compiled import CompiledNode
    from gap_runtime.run.activation import Frame

DEADLINE = "deadline"


class State(Enum):
    """RUNNING until the node's own thread settles it or the supervisor abandons it, whichever comes first."""

    RUNNING = 0
    SETTLED = 1
    ABANDONED = 2


RUNNING, SETTLED, ABANDONED = State.RUNNING, State.SETTLED, State.ABANDONED  # looked up once


class Attempt:
    """A node being run. A result that comes after the attempt was abandoned is dropped, by identity of this object.

    `deadline` is on the monotonic clock, `world_deadline` on the world's (set when the node first touches the world);
    `deadline_s` is what the node, or the `tool` it is calling, was allowed.
    `world_wall_s` is wall time spent inside the world, so that the rest is what the robot would wait for computing.
    """

    # Defaults live on the class: most attempts change few of them, and thousands are made.
    started = ended = cancelled_at = world_wall_s = 0.0
    deadline = world_deadline = math.inf
    cancelled = tool = ""
    apart = False  # looks at the world by itself, which therefore cannot wait for it
    closing = False  # frees what it holds; it may look on until it is abandoned
    state = RUNNING
    value: Any = None
    error: BaseException | None = None
    inputs: Mapping[str, Any] = MappingProxyType({})
    extra: Mapping[str, Any] | None = None
    send: tuple[int, int] | None = None
    calls: list[tuple[str, float, dict[str, Any]]] | None = None
    finished: Event  # of a streaming node: its thread is over

    def __init__(self, node: CompiledNode, frame: Frame) -> None:
        self.id = next(frame.ids)
        self.node, self.frame = node, frame
        self.deadline_s = node.deadline_s

    def begin(self, patience: float) -> None:
        """Start its clock; waiting for a thread does not count."""
        self.started = monotonic()
        if not self.node.streaming:
            self.deadline = self.started + self.deadline_s * patience

    def cancel(self, why: str) -> None:
        """Ask the node to stop; the first reason given stays."""
        if not self.cancelled:
            self.cancelled_at = monotonic()
            self.cancelled = why

    def check(self) -> None:
        """Raise `CancelledError`, or `ToolError` code `deadline`, where the node must not go on."""
        if self.closing and self.cancelled and self.state is RUNNING:
            return
        if self.cancelled == DEADLINE:
            raise deadline_error(self)
        if self.cancelled or self.state is ABANDONED:
            raise CancelledError(f"{self.node.path} was told to stop: {self.cancelled.rstrip('.')}.")
        if monotonic() > self.deadline:
            if not self.tool:  # the node's own time is up; that of a tool it calls is for the node to deal with
                self.cancel(DEADLINE)
            raise deadline_error(self)

    def settle(self, lock: Lock, value: Any, error: BaseException | None) -> bool:
        """Record how it ended; False when it was abandoned before, and its result is dropped."""
        with lock:
            if self.state is not RUNNING:
                return False
            self.state = SETTLED
        self.ended = monotonic()
        self.value, self.error = value, error
        return True

    def abandon(self, lock: Lock) -> bool:
        """Give up on it; False when it settled before."""
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
    def keeps_pace(self) -> bool:
        """True while the world may wait for this streaming node."""
        return self.state is RUNNING and not self.cancelled and not self.apart

    @property
    def stopped(self) -> bool:
        """True when it ended because it was told to, for a reason that is not its own."""
        return self.error is not None and self.cancelled not in ("", DEADLINE)

    @property
    def compute_s(self) -> float:
        """Wall time it took outside the world: what the robot would have waited for."""
        return max(0.0, self.ended - self.started - self.world_wall_s) if self.started and self.ended else 0.0


def deadline_error(attempt: Attempt) -> ToolError:
    """The error of a node that ran out of time."""
    return ToolError(
        DEADLINE,
        f"{attempt.node.path} took longer than the {attempt.deadline_s:g} s of {attempt.tool or 'the node'}.",
        hint="" if attempt.tool else "Give the node a larger deadline_s if it is meant to take that long.",
    )
