"""Watches a run from outside the thread that runs it: deadlines, Ctrl-C, budgets, and nodes that do not stop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic

from gap_runtime.run.attempt import DEADLINE, RUNNING, Attempt
from gap_runtime.run.graph_run import Status
from gap_runtime.run.pool import runner_pool
from gap_runtime.run.scheduler import Scheduler
from gap_runtime.safety.protective_stop import stop_arms

TICK_S = 0.02
GRACE_S = 1.0


class Supervisor:
    """Runs a scheduler on a thread of its own and stays on the caller's, where signals arrive.

    A node past its deadline is told to stop and the arms are stopped; `grace_s` later it is abandoned: its thread is
    left behind, its result will be dropped, and a new thread takes the graph over.
    """

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        cancel: threading.Event | None,
        budget_s: float | None,
        recovery_budget_s: float,
        grace_s: float,
        heartbeat: Callable[[], None] | None,
    ) -> None:
        self._scheduler, self._graph_run = scheduler, scheduler.graph_run
        self._cancel, self._heartbeat = cancel, heartbeat
        self._grace_s, self._recovery_budget_s = grace_s, recovery_budget_s
        self._end = None if budget_s is None else monotonic() + budget_s
        self._budget_s = budget_s
        self._interrupts = 0
        self._idle = threading.Event()  # of the thread that runs the graph now: it has returned

    def run(self) -> None:
        """Until the run is over. A first Ctrl-C cancels the run, a second one its recovery."""
        self._start_runner()
        while not self._graph_run.over.is_set():
            try:
                while not self._graph_run.over.wait(TICK_S):
                    self._tick()
            except KeyboardInterrupt:
                self._interrupts += 1  # acted upon in the next tick, where another one cannot get in between
        self._idle.wait(self._grace_s)

    def _start_runner(self) -> None:
        idle = self._idle = threading.Event()

        def run() -> None:
            self._scheduler.loop()
            idle.set()

        runner_pool().submit(run)

    def _tick(self) -> None:
        now = monotonic()
        if self._heartbeat is not None:
            self._heartbeat()
        while self._interrupts:
            self._interrupts -= 1
            self._stop("cancelled", "Interrupted.")
        if self._scheduler.stopping is None:
            if self._cancel is not None and self._cancel.is_set():
                self._stop("cancelled", "Cancelled.")
            elif self._end is not None and now > self._end:
                self._stop("error", f"The run took longer than its {self._budget_s:g} s.")
        if self._graph_run.recovering and now > self._graph_run.recovery_began + self._recovery_budget_s:
            self._skip_recovery()
        for attempt in self._scheduler.active():
            if attempt.state is RUNNING and attempt.started:
                self._watch(attempt, now)

    def _watch(self, attempt: Attempt, now: float) -> None:
        if now > attempt.deadline and not attempt.cancelled:
            late = now - attempt.deadline
            if late > self._grace_s or not attempt.tool:  # a tool it calls gets the grace to say so itself
                attempt.cancel(DEADLINE)
            if attempt.node.effect == "actuate" and (attempt.cancelled or late <= TICK_S * 2):
                self._scheduler.stop_arms_of([attempt])
        elif attempt.cancelled and now > attempt.cancelled_at + self._grace_s:
            self._abandon(attempt)

    def _abandon(self, attempt: Attempt) -> None:
        scheduler, step, flights = self._scheduler, self._scheduler.step, self._scheduler.in_flight
        inline = step is not None and step.current is attempt
        if step is not None and attempt in step.attempts:
            abandoned = step.abandon(scheduler.services, attempt)
        else:
            abandoned = flights is not None and flights.abandon(attempt)
        if not abandoned:
            return
        stop_arms(scheduler.services.cell)
        if inline:
            self._start_runner()
        else:
            scheduler.pool.replace_one()

    def _stop(self, status: Status, reason: str) -> None:
        scheduler = self._scheduler
        if scheduler.stopping is not None:
            self._skip_recovery()
            return
        scheduler.stopping = (status, reason)
        if not self._graph_run.recovering:
            self._stop_step(reason)

    def _skip_recovery(self) -> None:
        if not self._scheduler.skip_recovery:
            self._scheduler.skip_recovery = True
            self._stop_step("the recovery is cut short")

    def _stop_step(self, reason: str) -> None:
        self._scheduler.cancel(reason)
        stop_arms(self._scheduler.services.cell)
