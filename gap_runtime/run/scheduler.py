"""Plans, executes and commits until the graph has reached an end."""

from __future__ import annotations

import random
from collections.abc import Sequence

from gap_runtime.contracts.failures import CancelledError
from gap_runtime.errors import ExecutionError
from gap_runtime.run.activation import SubgraphActivation
from gap_runtime.run.attempt import COMPLETED, Attempt
from gap_runtime.run.events import Emitter
from gap_runtime.run.graph_run import FATAL, GraphRun, Status
from gap_runtime.run.in_flight import InFlight, make_in_flight, refuse_conflicts
from gap_runtime.run.pool import Pool
from gap_runtime.run.services import Services
from gap_runtime.run.streaming import start_streaming
from gap_runtime.run.superstep import SIBLING, ParallelStep, SuperStep, ThreadAbandoned, related
from gap_runtime.safety.protective_stop import stop_arms


class Scheduler:
    """Drives a `GraphRun`. `loop` may be abandoned in the middle of a node and taken up again by another thread.

    What is ready at an instant of cell time and does not command the cell is run to its end first, as super-steps; only
    then do the nodes that command the cell begin, and stay in flight while others become ready. On a real clock
    everything is in flight at once.
    """

    def __init__(
        self,
        graph_run: GraphRun,
        pool: Pool,
        *,
        lockstep: bool,
        shuffle: random.Random | None,
        cell_deadline: float | None,
    ) -> None:
        self.graph_run, self.pool = graph_run, pool
        self.services: Services = graph_run.services
        self.emitter: Emitter = graph_run.emitter
        self.step: SuperStep | None = None
        self.in_flight: InFlight | None = make_in_flight(self.services, pool)
        self.stopping: tuple[Status, str] | None = None  # set by the supervisor
        self.skip_recovery = False  # set by the supervisor: no recovery, or no more of it
        self._waiting: list[Attempt] = []  # to command the cell, once nothing else is ready
        self._streams = False  # whether any streaming node has been started
        self._lockstep, self._shuffle, self._cell_deadline = lockstep, shuffle, cell_deadline

    def loop(self) -> None:
        """Run until the graph has ended, or until this thread is abandoned."""
        over = self.graph_run.over
        try:
            while not over.is_set():
                try:
                    self._advance()
                except ExecutionError as error:
                    self._end_flights(str(error))
                    self.graph_run.outcome.failures.append(("", error))
                    self.graph_run.abort("error", str(error))
        except ThreadAbandoned:
            return
        except BaseException as error:
            self.cancel("the run failed")
            stop_arms(self.services.cell)
            self.graph_run.fail(error)

    def active(self) -> list[Attempt]:
        """What runs now, or is about to; streaming nodes apart."""
        step, flights = self.step, self.in_flight
        return [*(step.attempts if step is not None else ()), *(flights.attempts if flights is not None else ())]

    def cancel(self, why: str) -> None:
        """Tell everything that runs to stop. Thread-safe: only flags are set."""
        for attempt in self.active():
            attempt.cancel(why)

    def stop_arms_of(self, failed: Sequence[Attempt]) -> list[str]:
        """Stop every arm that is not held by a node which goes on; see `stop_arms`."""
        goes_on = [a for a in self.active() if not a.cancelled and a not in failed and a.error is None]
        spared = {arm for attempt in goes_on for arm in self.services.leases.arms_of(attempt)} if goes_on else ()
        return stop_arms(self.services.cell, spared)

    def _advance(self) -> None:
        step = self.step or self._plan()
        if step is not None:
            step.run(self.services, self.pool)
            self.step = None
            step.cancel_after_failure()
            self._commit(step.attempts)

    def _plan(self) -> SuperStep | None:
        """The next super-step; None where the run moved on without one."""
        graph_run = self.graph_run
        if self.skip_recovery:
            self._end_flights("the recovery is cut short")
            graph_run.close()
            return None
        if not graph_run.recovering and self._cut_short():
            return None
        if graph_run.has_pending:
            if graph_run.fails_next:
                self._end_flights(SIBLING)
            graph_run.enter_ready()
        flights = self._flights()
        ready = self._ready([*flights, *self._waiting] if flights or self._waiting else [])
        if len(ready) == 1 and not self._waiting and not flights:
            self.step = SuperStep(ready)
        elif ready or self._waiting:
            self._begin(ready)
        else:
            self._go_on_without(flights)
        if self.step is not None:
            if self._streams:
                for streamer in self._broken_streams():  # before this step was there to be told
                    self.step.cancel_siblings(streamer)
            self._announce(self.step.attempts)
        return self.step

    def _begin(self, ready: list[Attempt]) -> None:
        """Make a super-step of what does not command the cell; or, where nothing else is ready, start what does."""
        flights, waiting = self.in_flight, self._waiting
        waiting += [a for a in ready if self._flies(a)]
        batch = [a for a in ready if not self._flies(a)]
        if batch:
            self.step = ParallelStep(batch, lockstep=self._lockstep, shuffle=self._shuffle)
        elif flights is None or (len(waiting) == 1 and not flights.attempts):
            self.step = SuperStep([waiting.pop(0)])
        elif refused := refuse_conflicts(waiting):
            self._waiting = [a for a in waiting if a.error is None]
            self._commit(refused)
        else:
            self._waiting = []
            self._announce(waiting)
            flights.start(waiting)

    def _flies(self, attempt: Attempt) -> bool:
        """True for what is in flight while other nodes run."""
        cell = self.services.cell
        return cell is not None and (attempt.node.effect == "actuate" or cell.real_time)

    def _flights(self) -> list[Attempt]:
        return self.in_flight.attempts if self.in_flight is not None else []

    def _go_on_without(self, flights: list[Attempt]) -> None:
        """Nothing is ready: leave what is idle, or wait."""
        graph_run = self.graph_run
        if broken := self._broken_streams():
            self._commit_failure([], broken)
        elif graph_run.over.is_set() or graph_run.finish_idle({a.activation.top for a in flights}):
            return
        elif self.in_flight is not None and flights:
            self._commit(self.in_flight.wait())
        else:
            raise ExecutionError("The graph came to a stop before it reached an end.", ())

    def _ready(self, busy: list[Attempt]) -> list[Attempt]:
        """What may run now; nothing while an activation is to be left: what follows it is not to wait for the rest."""
        activations = self.graph_run.in_order()
        if len(activations) == 1 and not busy:
            return self._ready_of(activations[0], 0)
        nodes = {a.top: 0 for a in activations}
        for attempt in busy:
            nodes[attempt.activation.top] |= 1 << attempt.node.index
        if not all(a.queue.pending or nodes[a.top] for a in activations):
            return []
        return [attempt for a in activations for attempt in self._ready_of(a, nodes[a.top])]

    def _ready_of(self, activation: SubgraphActivation, busy: int) -> list[Attempt]:
        ready = activation.ready(busy)
        if not activation.subgraph.streams:
            return ready
        self._streams = True
        streaming = [a for a in ready if a.node.streaming]
        for attempt in streaming:
            self._announce([attempt])
            start_streaming(self.services, attempt, self._stream_failed)
        return [a for a in ready if not a.node.streaming]

    def _cut_short(self) -> bool:
        cell = self.services.cell
        if self.stopping is not None:
            status, reason = self.stopping
        elif cell is not None and self._cell_deadline is not None and cell.time > self._cell_deadline:
            status, reason = "error", "The task's time is up."
        else:
            return False
        self._end_flights(reason)
        self.graph_run.abort(status, reason)
        return True

    def _announce(self, attempts: Sequence[Attempt]) -> None:
        for attempt in attempts if self.emitter else ():
            node = attempt.node
            callee = node.callee.name if node.callee else ""
            self.emitter.emit(
                "node_started", node.path, type=node.kind, callee=callee, attempt=attempt.id, streaming=node.streaming
            )

    def _stream_failed(self, streamer: Attempt) -> None:
        for attempt in self.active():
            if related(streamer, attempt):
                attempt.cancel(SIBLING)

    def _commit(self, ended: Sequence[Attempt]) -> None:
        """Take over outputs in order, then let control move on."""
        failed = self._take_over(ended)
        broken = self._broken_streams() if self._streams else []
        if failed or broken:
            self._commit_failure(ended, [*broken, *failed])
        else:
            self._let_go(ended)

    def _commit_failure(self, ended: Sequence[Attempt], failed: list[Attempt]) -> None:
        """End what shares the fate of what failed, stop its arms, and leave the activations."""
        ended = [*ended, *self._end_related(failed)]
        problems = self.stop_arms_of(failed)
        self._let_go(ended)
        if problems:
            self._end_flights("an arm could not be stopped")
            self.graph_run.fail(ExecutionError("; ".join(problems), (), hint="Stop the robot by hand."))
        else:
            if any(isinstance(attempt.error, FATAL) for attempt in failed):
                self._end_flights("the run failed")
            self.graph_run.leave_failed(failed, stopping=self.stopping is not None)

    def _take_over(self, ended: Sequence[Attempt]) -> list[Attempt]:
        """Commit what succeeded; those that failed."""
        seconds = 0.0
        for attempt in ended:
            if attempt.error is None and attempt.state is COMPLETED:
                try:
                    attempt.activation.commit(attempt)
                except Exception as error:
                    attempt.error = error
            elif attempt.error is None:  # never started: a sibling failed first
                attempt.error = CancelledError(f"{attempt.path} was not started.")
            seconds = max(seconds, attempt.compute_s)
        self.graph_run.outcome.compute_s += seconds
        return [a for a in ended if a.error is not None]

    def _let_go(self, ended: Sequence[Attempt]) -> None:
        for attempt in ended:
            if attempt.node.effect != "pure":
                self.services.leases.release(attempt)
            if self.emitter:
                self.emitter.attempt_ended(attempt)

    def _end_related(self, failed: list[Attempt]) -> list[Attempt]:
        """Cancel what waits or is in flight and does not go on, and wait for its end. Adds to `failed` what failed."""
        ended = [a for a in self._waiting if any(related(f, a) for f in failed)]
        self._waiting = [a for a in self._waiting if a not in ended]
        for attempt in ended:
            attempt.cancel(SIBLING)
        failed += self._take_over(ended)
        flights = self.in_flight
        while flights is not None and any(related(f, a) for f in failed for a in flights.attempts):
            for attempt in flights.attempts:
                if any(related(f, attempt) for f in failed):
                    attempt.cancel(SIBLING)
            self.stop_arms_of(failed)
            more = flights.wait()
            failed += self._take_over(more)
            ended += more
        return ended

    def _end_flights(self, why: str) -> None:
        """Cancel everything in flight, stop the arms and wait for its end."""
        self._waiting = []
        flights = self.in_flight
        if flights is None or not flights.attempts:
            return
        self.cancel(why)
        stop_arms(self.services.cell)
        while flights.attempts:
            ended = flights.wait()
            failed = self._take_over(ended)
            self._let_go(ended)
            for attempt in failed:
                self.graph_run.record(attempt, stopping=self.stopping is not None)

    def _broken_streams(self) -> list[Attempt]:
        return [s for f in self.graph_run.activations.values() for s in f.streamers if s.error is not None]
