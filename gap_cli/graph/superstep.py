"""Executes one super-step: what only looks or computes runs in parallel, then what moves runs one by one, in order."""

from __future__ import annotations

import queue
import random
from collections import deque
from collections.abc import Sequence

from gap_cli.contracts.failures import ToolError
from gap_cli.graph.attempt import Attempt, State
from gap_cli.graph.context import Services
from gap_cli.graph.perform import perform
from gap_cli.graph.pool import Pool

SIBLING = "another branch failed"


class Abandoned(BaseException):
    """This thread was given up on while it ran a node; another has taken over the graph."""


class SuperStep:
    """The attempts of one step and how far they got. It can be taken over by another thread between two of them.

    Movers run alone and after all others, in sorted order, so that the world does not depend on timing. With
    `lockstep`, a failure lets the siblings before it finish: the first failure by order is then the same every time.
    """

    def __init__(self, attempts: Sequence[Attempt], *, lockstep: bool, shuffle: random.Random | None) -> None:
        self.attempts = list(attempts)
        self.current: Attempt | None = None  # the one on the scheduler's own thread
        self._lockstep = lockstep
        self._done: queue.SimpleQueue[Attempt] = queue.SimpleQueue()
        watchers = [a for a in self.attempts if a.node.effect != "actuate"]
        self._movers = deque(a for a in self.attempts if a.node.effect == "actuate")
        if shuffle is not None:
            shuffle.shuffle(watchers)
        self._watchers = deque(watchers)
        self._open = len(watchers)
        self._submitted = False

    def run(self, services: Services, pool: Pool) -> None:
        """Run what is left. Raises `Abandoned` on a thread that was given up."""
        if not self._submitted and self._open > 1:
            self._submitted = True
            for _ in range(self._open - 1):
                pool.submit(lambda: self._drain(services))
        for attempt in refuse_conflicts(self._movers):
            self.cancel_siblings(attempt)
        self._help(services)
        while self._open:
            self._done.get()
            self._open -= 1
        while self._movers:
            attempt = self._movers.popleft()
            if attempt.state is State.RUNNING and not attempt.cancelled and attempt.error is None:
                self._inline(services, attempt)

    def give_up(self, services: Services, attempt: Attempt) -> bool:
        """Abandon an attempt that does not stop; False when it ended meanwhile."""
        if not attempt.abandon(services.settling):
            return False
        self.cancel_siblings(attempt)
        if attempt.node.effect != "actuate":
            self._done.put(attempt)
        return True

    def cancel(self, why: str) -> None:
        """Tell everything in this step to stop."""
        for attempt in self.attempts:
            if attempt.state is State.RUNNING:
                attempt.cancel(why)

    def _help(self, services: Services) -> None:
        """Run parallel branches on this thread too, as long as some have no thread yet."""
        while self._watchers:
            try:
                attempt = self._watchers.popleft()
            except IndexError:
                return
            self._inline(services, attempt)
            self._done.put(attempt)

    def _inline(self, services: Services, attempt: Attempt) -> None:
        self.current = attempt
        if not perform(services, attempt):
            raise Abandoned
        self.current = None
        if attempt.error is not None:
            self.cancel_siblings(attempt)

    def _drain(self, services: Services) -> None:
        try:
            attempt = self._watchers.popleft()
        except IndexError:
            return
        if perform(services, attempt):
            if attempt.error is not None:
                self.cancel_siblings(attempt)
            self._done.put(attempt)

    def cancel_siblings(self, failed: Attempt) -> None:
        """Tell those that share the failed one's fate. Thread-safe: only flags are set."""
        later = self.attempts
        if self._lockstep and failed in later:
            later = later[later.index(failed) + 1 :]
        for attempt in later:
            related = failed.frame.ends_run or attempt.frame is failed.frame
            if related and attempt is not failed and attempt.state is State.RUNNING:
                attempt.cancel(SIBLING)


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
