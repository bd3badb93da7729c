"""Executes one super-step: what only looks or computes runs in parallel, then what moves runs one by one, in order."""

from __future__ import annotations

import queue
import random
from collections import deque
from collections.abc import Sequence

from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.run.attempt import RUNNING, Attempt
from gap_runtime.run.context import Services
from gap_runtime.run.perform import perform
from gap_runtime.run.pool import Pool

SIBLING = "another branch failed"


class Abandoned(BaseException):
    """This thread was given up on while it ran a node; another has taken over the graph."""


class SuperStep:
    """A step of one node. It can be taken over by another thread when its own is stuck; `current` is what runs here."""

    __slots__ = ("attempts", "current")

    def __init__(self, attempts: list[Attempt]) -> None:
        self.attempts = attempts
        self.current: Attempt | None = None

    def run(self, services: Services, pool: Pool) -> None:
        """Run what is left of it. Raises `Abandoned` on a thread that was given up."""
        attempt = self.attempts[0]
        if attempt.state is RUNNING:
            self.perform_here(services, attempt)

    def perform_here(self, services: Services, attempt: Attempt) -> None:
        """Run one attempt on the scheduler's own thread. Raises `Abandoned` on a thread that was given up."""
        self.current = attempt
        if not perform(services, attempt):
            raise Abandoned
        self.current = None

    def give_up(self, services: Services, attempt: Attempt) -> bool:
        """Abandon an attempt that does not stop; False when it ended meanwhile."""
        return attempt.abandon(services.settling)

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

    def overrule(self) -> None:
        """Once all has ended: where it must not depend on timing, what a failure would have stopped did not happen."""

    def _after(self, failed: Attempt) -> list[Attempt]:
        return self.attempts


class ParallelStep(SuperStep):
    """A step of several nodes.

    Movers run alone and after all others, in sorted order, so that the world does not depend on timing. With
    `lockstep`, a failure lets the siblings before it finish: the first failure by order is then the same every time.
    """

    __slots__ = ("_done", "_lockstep", "_movers", "_open", "_submitted", "_watchers")

    def __init__(self, attempts: list[Attempt], *, lockstep: bool, shuffle: random.Random | None) -> None:
        super().__init__(attempts)
        self._lockstep = lockstep
        self._done: queue.SimpleQueue[Attempt] = queue.SimpleQueue()
        watchers = [a for a in attempts if a.node.effect != "actuate"]
        if shuffle is not None:
            shuffle.shuffle(watchers)
        self._watchers = deque(watchers)
        self._movers = deque(a for a in attempts if a.node.effect == "actuate")
        self._open = len(watchers)
        self._submitted = False

    def run(self, services: Services, pool: Pool) -> None:
        """Run what is left of it. Raises `Abandoned` on a thread that was given up."""
        if not self._submitted:
            self._submitted = True
            for attempt in refuse_conflicts(self._movers):
                self.cancel_siblings(attempt)
            for _ in range(self._open - 1):
                pool.submit(lambda: self._run_one(services))
        while (watcher := self._next()) is not None:  # this thread helps, as long as some have no thread yet
            self.perform_here(services, watcher)
            self._ended(watcher)
        while self._open:
            self._done.get()
            self._open -= 1
        while self._movers:
            mover = self._movers.popleft()
            if mover.state is RUNNING and not mover.cancelled and mover.error is None:
                self.perform_here(services, mover)
                services.leases.yield_clock(mover)
                if mover.error is not None:
                    self.cancel_siblings(mover)

    def give_up(self, services: Services, attempt: Attempt) -> bool:
        """Abandon an attempt that does not stop; False when it ended meanwhile."""
        if not super().give_up(services, attempt):
            return False
        if attempt.node.effect == "actuate":
            services.leases.yield_clock(attempt)
            self.cancel_siblings(attempt)
        else:
            self._ended(attempt)
        return True

    def overrule(self) -> None:
        """In lockstep, a watcher behind one that failed counts as stopped, even if it had ended by then."""
        watchers = [a for a in self.attempts if a.node.effect != "actuate"] if self._lockstep else []
        for i, failed in enumerate(watchers):
            if failed.error is None or failed.stopped:
                continue
            for attempt in watchers[i + 1 :]:
                if _related(failed, attempt):
                    attempt.cancelled = SIBLING
                    attempt.error = CancelledError(f"{attempt.node.path} was told to stop: {SIBLING}.")

    def _next(self) -> Attempt | None:
        try:
            return self._watchers.popleft()
        except IndexError:
            return None

    def _run_one(self, services: Services) -> None:
        attempt = self._next()
        if attempt is not None and perform(services, attempt):
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
    return attempt is not failed and (failed.frame.ends_run or attempt.frame is failed.frame)


def refuse_conflicts(movers: Sequence[Attempt]) -> list[Attempt]:
    """Fail, before anything moves, every attempt that would hold what another of the same step holds."""
    refused = []
    for attempt in movers if len(movers) > 1 else ():
        for other in movers:
            both = sorted(set(attempt.node.resources) & set(other.node.resources))
            if other is not attempt and both and attempt.error is None:
                attempt.error = ToolError(
                    "lease",
                    f"{attempt.node.path} and {other.node.path} would hold {', '.join(both)} at the same time.",
                    hint="Put one of the two behind the other with an edge.",
                )
                refused.append(attempt)
    return refused
