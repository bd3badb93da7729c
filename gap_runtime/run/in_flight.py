"""Nodes that run while the graph goes on beside them: all at once on a real clock, in turns on a stepped one."""

from __future__ import annotations

import queue
from collections.abc import Sequence
from functools import partial
from threading import Event, Semaphore

from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.simulator import SteppedCell, SteppedClock, TimedCommand, waiting_by
from gap_runtime.run.attempt import Attempt
from gap_runtime.run.context import execute_node
from gap_runtime.run.leases import CLOCK
from gap_runtime.run.pool import Pool, runner_pool
from gap_runtime.run.services import Services


class InFlight:
    """What runs on a real clock, whose time passes by itself: everything at once."""

    def __init__(self, services: Services, pool: Pool) -> None:
        self.attempts: list[Attempt] = []  # in the order they were started
        self._services, self._pool = services, pool
        self._ended: queue.SimpleQueue[Attempt] = queue.SimpleQueue()

    def start(self, attempts: Sequence[Attempt]) -> None:
        """Run each on a thread of its own; what only computes or looks may have to wait for one."""
        self.attempts += attempts
        for attempt in attempts:
            pool = runner_pool() if attempt.node.effect == "actuate" else self._pool
            pool.submit(partial(self._execute, attempt))

    def wait(self) -> list[Attempt]:
        """Those that have ended, at least one, in order."""
        ended = [self._ended.get()]
        while not self._ended.empty():
            ended.append(self._ended.get())
        self.attempts = [a for a in self.attempts if a not in ended]
        return sorted(ended, key=lambda a: a.id)

    def abandon(self, attempt: Attempt) -> bool:
        """Abandon one that does not stop; False when it ended meanwhile."""
        if not attempt.abandon(self._services.completing):
            return False
        self._ended.put(attempt)
        return True

    def _execute(self, attempt: Attempt) -> None:
        if execute_node(self._services, attempt):
            self._ended.put(attempt)


class Turns(InFlight):
    """What runs on a stepped clock. One node runs at a time, in the order they were started, until it waits for time
    or ends; when all of them wait, time passes until one has what it waited for. So nothing depends on the machine."""

    def __init__(self, services: Services, pool: Pool, clock: SteppedClock) -> None:
        super().__init__(services, pool)
        self._clock = clock
        self._members: list[_Member] = []
        self._news: queue.SimpleQueue[None] = queue.SimpleQueue()

    def start(self, attempts: Sequence[Attempt]) -> None:
        """Let them take part; each begins with its first turn."""
        self.attempts += attempts
        self._members += [_Member(attempt) for attempt in attempts]

    def wait(self) -> list[Attempt]:
        """The one that ended first, by time and then by order."""
        while True:
            ended = next((m for m in self._members if m.ended), None)
            if ended is not None:
                self._members.remove(ended)
                self.attempts.remove(ended.attempt)
                return [ended.attempt]
            ready = next((m for m in self._members if m.ready), None)
            if ready is None:
                self._let_time_pass()
            else:
                self._give_turn(ready)

    def abandon(self, attempt: Attempt) -> bool:
        """Abandon one that does not stop; False when it ended meanwhile."""
        if not attempt.abandon(self._services.completing):
            return False
        member = next(m for m in self._members if m.attempt is attempt)
        member.ended = True
        member.turn.release()
        self._news.put(None)
        return True

    def _give_turn(self, member: _Member) -> None:
        """Until it waits for time, or has ended."""
        if not member.started:
            member.started = True
            runner_pool().submit(partial(self._run, member))
        else:
            member.command = None
            member.turn.release()
        while member.command is None and not member.ended:
            self._news.get()

    def _run(self, member: _Member) -> None:
        def wait(command: TimedCommand) -> None:
            member.command = command
            self._news.put(None)
            member.turn.acquire()
            if not command.over:
                member.attempt.check()  # abandoned

        with waiting_by(wait):
            if execute_node(self._services, member.attempt):
                member.ended = True
                self._news.put(None)

    def _let_time_pass(self) -> None:
        """On another thread, so that a cell that hangs does not hang the graph once all its nodes are abandoned."""
        commands = [m.command for m in self._members if m.command is not None]
        passed = Event()

        def advance() -> None:
            try:
                self._clock.advance(commands, lambda: any(m.ended for m in self._members))
            finally:
                passed.set()
                self._news.put(None)

        runner_pool().submit(advance)
        while not passed.is_set() and not all(m.ended for m in self._members):
            self._news.get()


class _Member:
    """One node, and what it waits for: its first turn, then a command to be over."""

    def __init__(self, attempt: Attempt) -> None:
        self.attempt = attempt
        self.command: TimedCommand | None = None
        self.turn = Semaphore(0)
        self.started = self.ended = False

    @property
    def ready(self) -> bool:
        """True when it could run now."""
        return not self.ended and (not self.started or (self.command is not None and self.command.over))


def refuse_conflicts(starting: Sequence[Attempt]) -> list[Attempt]:
    """Fail, before anything moves, every attempt that would hold what another of the same step holds."""
    refused = []
    for attempt in starting if len(starting) > 1 else ():
        for other in starting:
            both = sorted((set(attempt.node.resources) & set(other.node.resources)) - {CLOCK})
            if other is not attempt and both and attempt.error is None:
                attempt.error = ToolError(
                    "lease",
                    f"{attempt.path} and {other.path} would hold {', '.join(both)} at the same time.",
                    hint="Put one of the two behind the other with an edge.",
                )
                refused.append(attempt)
    return refused


def make_in_flight(services: Services, pool: Pool) -> InFlight | None:
    """What lets several nodes command the cell at once; None for a cell that takes one command at a time."""
    cell = services.cell
    if cell is None:
        return None
    if cell.real_time:
        return InFlight(services, pool)
    return Turns(services, pool, cell.clock) if isinstance(cell, SteppedCell) else None
