"""Executes one super-step: what only looks or computes runs in parallel, then what moves runs one by one, in order."""

from __future__ import annotations

import queue
import random
from collections import deque
from collections.abc import Sequence

from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.run.attempt import RUNNING, Attempt
from gap_runtime.run.context import execute_node
from gap_runtime.run.pool import Pool
from gap_runtime.run.services import Services

SIBLING = "another branch failed"


class ThreadAbandoned(BaseException):
    """This thread was abandoned while it ran a node; another has taken over the graph."""


class SuperStep:
    """A step of one node. It can be taken over by another thread when its own is stuck; `current` is what runs here."""

    __slots__ = ("attempts", "current")

    def __init__(self, attempts: list[Attempt]) -> None:
        self.attempts = attempts
        self.current: Attempt | None = None

    def run(self, services: Services, pool: Pool) -> None:
        """Run what is left of it. Raises `ThreadAbandoned` on a thread that was abandoned."""
        attempt = self.attempts[0]
        if attempt.state is RUNNING:
            self.execute_here(services, attempt)

    def execute_here(self, services: Services, attempt: Attempt) -> None:
        """Run one attempt on the scheduler's own thread. Raises `ThreadAbandoned` on a thread that was abandoned."""
        self.current = attempt
        if not execute_node(services, attempt):
            raise ThreadAbandoned
        self.current = None

    def abandon(self, services: Services, attempt: Attempt) -> bool:
        """Abandon an attempt that does not stop; False when it ended meanwhile."""
        return attempt.abandon(services.completing)

    def cancel(self, why: str) -> None:
        """Tell everything in this step to stop."""
        for attempt in self.attempts:
            if attempt.state is RUNNING:
                attempt.cancel(why)

    def cancel_siblings(self, failed: Attempt) -> None:
        """Tell those that share the failed one's fate. Thread-safe: only flags are set."""
        for attempt in self._after(failed):
            if _related(failed, attempt) and attempt.state is RUNNING:
                attempt.cancel(SIBLING)

    def cancel_after_failure(self) -> None:
        """Once all has ended: where it must not depend on timing, what a failure would have stopped did not happen."""

    def _after(self, failed: Attempt) -> list[Attempt]:
        return self.attempts


class ParallelStep(SuperStep):
    """A step of several nodes.

    Movers run alone and after all others, in sorted order, so that the cell does not depend on timing. With
    `lockstep`, a failure lets the siblings before it finish: the first failure by order is then the same every time.
    """

    __slots__ = ("_actuating", "_done", "_lockstep", "_open", "_sensing", "_submitted")

    def __init__(self, attempts: list[Attempt], *, lockstep: bool, shuffle: random.Random | None) -> None:
        super().__init__(attempts)
        self._lockstep = lockstep
        self._done: queue.SimpleQueue[Attempt] = queue.SimpleQueue()
        sensing = [a for a in attempts if a.node.effect != "actuate"]
        if shuffle is not None:
            shuffle.shuffle(sensing)
        self._sensing = deque(sensing)
        self._actuating = deque(a for a in attempts if a.node.effect == "actuate")
        self._open = len(sensing)
        self._submitted = False

    def run(self, services: Services, pool: Pool) -> None:
        """Run what is left of it. Raises `ThreadAbandoned` on a thread that was abandoned."""
        if not self._submitted:
            self._submitted = True
            for attempt in refuse_conflicts(self._actuating):
                self.cancel_siblings(attempt)
            for _ in range(self._open - 1):
                pool.submit(lambda: self._run_one(services))
        while (watcher := self._next()) is not None:  # this thread helps, as long as some have no thread yet
            self.execute_here(services, watcher)
            self._ended(watcher)
        while self._open:
            self._done.get()
            self._open -= 1
        while self._actuating:
            mover = self._actuating.popleft()
            if mover.state is RUNNING and not mover.cancelled and mover.error is None:
                self.execute_here(services, mover)
                services.leases.yield_clock(mover)
                if mover.error is not None:
                    self.cancel_siblings(mover)

    def abandon(self, services: Services, attempt: Attempt) -> bool:
        """Abandon an attempt that does not stop; False when it ended meanwhile."""
        if not super().abandon(services, attempt):
            return False
        if attempt.node.effect == "actuate":
            services.leases.yield_clock(attempt)
            self.cancel_siblings(attempt)
        else:
            self._ended(attempt)
        return True

    def cancel_after_failure(self) -> None:
        """In lockstep, a watcher behind one that failed counts as stopped, even if it had ended by then."""
        sensing = [a for a in self.attempts if a.node.effect != "actuate"] if self._lockstep else []
        for i, failed in enumerate(sensing):
            if failed.error is None or failed.stopped:
                continue
            for attempt in sensing[i + 1 :]:
                if _related(failed, attempt):
                    attempt.cancelled = SIBLING
                    attempt.error = CancelledError(f"{attempt.node.path} was told to stop: {SIBLING}.")

    def _next(self) -> Attempt | None:
        try:
            return self._sensing.popleft()
        except IndexError:
            return None

    def _run_one(self, services: Services) -> None:
        attempt = self._next()
        if attempt is not None and execute_node(services, attempt):
            self._ended(attempt)

    def _ended(self, attempt: Attempt) -> None:
        if attempt.error is not None:
            self.cancel_siblings(attempt)
        self._done.put(attempt)

    def _after(self, failed: Attempt) -> list[Attempt]:
        if self._lockstep and failed in self.attempts:
            return self.attempts[self.attempts.index(failed) + 1 :]
        return self.attempts


def _related(failed: Attempt, attempt: Attempt) -> bool:
    """True when the second does not go on once the first has failed."""
    return attempt is not failed and (failed.activation.ends_run or attempt.activation is failed.activation)


def refuse_conflicts(actuating: Sequence[Attempt]) -> list[Attempt]:
    """Fail, before anything moves, every attempt that would hold what another of the same step holds."""
    refused = []
    for attempt in actuating if len(actuating) > 1 else ():
        for other in actuating:
            both = sorted(set(attempt.node.resources) & set(other.node.resources))
            if other is not attempt and both and attempt.error is None:
                attempt.error = ToolError(
                    "lease",
                    f"{attempt.node.path} and {other.node.path} would hold {', '.join(both)} at the same time.",
                    hint="Put one of the two behind the other with an edge.",
                )
                refused.append(attempt)
    return refused
