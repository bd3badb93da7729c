"""Executes one super-step: nodes that are ready at once, run to their ends before anything else is."""

from __future__ import annotations

import queue
import random
from collections import deque

from gap_runtime.contracts.failures import CancelledError
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

    def cancel_siblings(self, failed: Attempt) -> None:
        """Tell those that share the failed one's fate. Thread-safe: only flags are set."""
        for attempt in self._after(failed):
            if related(failed, attempt):
                attempt.cancel(SIBLING)

    def cancel_after_failure(self) -> None:
        """Once all has ended: where it must not depend on timing, what a failure would have stopped did not happen."""

    def _after(self, failed: Attempt) -> list[Attempt]:
        return self.attempts


class ParallelStep(SuperStep):
    """A step of several nodes, none of which commands the cell.

    With `lockstep`, a failure lets the siblings before it finish: the first failure by order is then the same every
    time.
    """

    __slots__ = ("_done", "_lockstep", "_open", "_submitted", "_waiting")

    def __init__(self, attempts: list[Attempt], *, lockstep: bool, shuffle: random.Random | None) -> None:
        super().__init__(attempts)
        self._lockstep = lockstep
        self._done: queue.SimpleQueue[Attempt] = queue.SimpleQueue()
        waiting = list(attempts)
        if shuffle is not None:
            shuffle.shuffle(waiting)
        self._waiting = deque(waiting)
        self._open = len(waiting)
        self._submitted = False

    def run(self, services: Services, pool: Pool) -> None:
        """Run what is left of it. Raises `ThreadAbandoned` on a thread that was abandoned."""
        if not self._submitted:
            self._submitted = True
            for _ in range(self._open - 1):
                pool.submit(lambda: self._run_one(services))
        while (attempt := self._next()) is not None:  # this thread helps, as long as some have no thread yet
            self.execute_here(services, attempt)
            self._ended(attempt)
        while self._open:
            self._done.get()
            self._open -= 1

    def abandon(self, services: Services, attempt: Attempt) -> bool:
        """Abandon an attempt that does not stop; False when it ended meanwhile."""
        if not super().abandon(services, attempt):
            return False
        self._ended(attempt)
        return True

    def cancel_after_failure(self) -> None:
        """In lockstep, a node behind one that failed counts as stopped, even if it had ended by then."""
        for i, failed in enumerate(self.attempts if self._lockstep else []):
            if failed.error is None or failed.stopped:
                continue
            for attempt in self.attempts[i + 1 :]:
                if related(failed, attempt):
                    attempt.cancelled = SIBLING
                    attempt.error = CancelledError(f"{attempt.path} was told to stop: {SIBLING}.")

    def _next(self) -> Attempt | None:
        try:
            return self._waiting.popleft()
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


def related(failed: Attempt, attempt: Attempt) -> bool:
    """True when the second does not go on once the first has failed."""
    same = attempt.activation is failed.activation
    return attempt is not failed and (failed.activation.ends_run or same)
