"""Plans, executes and commits super-steps until the graph has reached an end."""

from __future__ import annotations

import random

from gap_runtime.contracts.failures import CancelledError, PrivilegedReadError, SimulationDivergedError
from gap_runtime.errors import ExecutionError
from gap_runtime.run.activation import SubgraphActivation
from gap_runtime.run.attempt import COMPLETED, Attempt
from gap_runtime.run.events import Emitter
from gap_runtime.run.graph_run import GraphRun, Status
from gap_runtime.run.pool import Pool
from gap_runtime.run.services import Services
from gap_runtime.run.streaming import start_streaming
from gap_runtime.run.superstep import SIBLING, ParallelStep, SuperStep, ThreadAbandoned
from gap_runtime.safety.protective_stop import stop_arms

FATAL = (PrivilegedReadError, SimulationDivergedError)


class Scheduler:
    """Drives a `GraphRun`. `loop` may be abandoned in the middle of a node and taken up again by another thread."""

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
        self.stopping: tuple[Status, str] | None = None  # set by the supervisor
        self.skip_recovery = False  # set by the supervisor: no recovery, or no more of it
        self._streams = False  # whether any streaming node has been started
        self._lockstep, self._shuffle, self._cell_deadline = lockstep, shuffle, cell_deadline

    def loop(self) -> None:
        """Run until the graph has ended, or until this thread is abandoned."""
        over = self.graph_run.over
        try:
            while not over.is_set():
                try:
                    step = self.step or self._plan()
                    if step is not None:
                        step.run(self.services, self.pool)
                        self._commit(step)
                except ExecutionError as error:
                    self.graph_run.outcome.failures.append(("", error))
                    self.graph_run.abort("error", str(error))
        except ThreadAbandoned:
            return
        except BaseException as error:
            stop_arms(self.services.cell)
            self.graph_run.fail(error)

    def _plan(self) -> SuperStep | None:
        """The next super-step; None where the run moved on without one."""
        graph_run = self.graph_run
        if self.skip_recovery:
            graph_run.close()
        elif not graph_run.recovering and self._cut_short():
            return None
        if graph_run.has_pending:
            graph_run.enter_ready()
        attempts = self._attempts()
        if not attempts:
            if broken := self._broken_streams():
                stop_arms(self.services.cell)
                self._leave_failed(broken)
            elif not graph_run.over.is_set():
                graph_run.finish_idle()
            return None
        if len(attempts) == 1:
            self.step = SuperStep(attempts)
        else:
            self.step = ParallelStep(attempts, lockstep=self._lockstep, shuffle=self._shuffle)
        if self._streams:
            for streamer in self._broken_streams():  # before this step was there to be told
                self.step.cancel_siblings(streamer)
        if self.emitter:
            for attempt in attempts:
                self._announce(attempt)
        return self.step

    def _attempts(self) -> list[Attempt]:
        """What may run now; nothing while an activation is to be left: what follows it is not to wait for the rest."""
        activations = self.graph_run.in_order()
        if len(activations) == 1:
            return self._ready(activations[0])
        return [a for f in activations for a in self._ready(f)] if all(f.queue.pending for f in activations) else []

    def _cut_short(self) -> bool:
        cell = self.services.cell
        if self.stopping is not None:
            self.graph_run.abort(*self.stopping)
        elif cell is not None and self._cell_deadline is not None and cell.time > self._cell_deadline:
            self.graph_run.abort("error", "The task's time is up.")
        else:
            return False
        return True

    def _ready(self, activation: SubgraphActivation) -> list[Attempt]:
        ready = activation.ready()
        if not activation.subgraph.streams:
            return ready
        self._streams = True
        streaming = [a for a in ready if a.node.streaming]
        for attempt in streaming:
            self._announce(attempt)
            start_streaming(self.services, attempt, self._stream_failed)
        return [a for a in ready if not a.node.streaming]

    def _announce(self, attempt: Attempt) -> None:
        node = attempt.node
        callee = node.callee.name if node.callee else ""
        self.emitter.emit(
            "node_started", node.path, type=node.kind, callee=callee, attempt=attempt.id, streaming=node.streaming
        )

    def _stream_failed(self, attempt: Attempt) -> None:
        step = self.step
        if step is not None:
            step.cancel_siblings(attempt)

    def _commit(self, step: SuperStep) -> None:
        """Take over outputs in the order of the plan, then let control move on."""
        self.step = None
        step.cancel_after_failure()
        failed = False
        looked, moved = 0.0, 0.0
        for attempt in step.attempts:
            if attempt.error is None and attempt.state is COMPLETED:
                try:
                    attempt.activation.commit(attempt)
                except Exception as error:
                    attempt.error = error
            elif attempt.error is None:  # never started: a sibling failed first
                attempt.error = CancelledError(f"{attempt.node.path} was not started.")
            if attempt.error is not None:
                failed = True
            if attempt.node.effect == "actuate":
                moved += attempt.compute_s
            elif (seconds := attempt.compute_s) > looked:
                looked = seconds
        self.graph_run.outcome.compute_s += looked + moved
        broken = self._broken_streams() if self._streams else []
        problems = stop_arms(self.services.cell) if failed or broken else []
        for attempt in step.attempts:
            if attempt.node.effect != "pure":
                self.services.leases.release(attempt)
            if self.emitter:
                self.emitter.attempt_ended(attempt)
        if problems:
            self.graph_run.fail(ExecutionError("; ".join(problems), (), hint="Stop the robot by hand."))
        elif failed or broken:
            self._leave_failed([*broken, *(a for a in step.attempts if a.error is not None)])

    def _broken_streams(self) -> list[Attempt]:
        return [s for f in self.graph_run.activations.values() for s in f.streamers if s.error is not None]

    def _leave_failed(self, failed: list[Attempt]) -> None:
        """Route each activation with a failure of its own to its `on_error`; a recovery only moves on. One that was
        stopped by a failure beside it is dropped with the end that this leads to."""
        graph_run = self.graph_run
        by_activation: dict[int, list[Attempt]] = {}
        for attempt in failed:
            assert attempt.error is not None
            by_activation.setdefault(attempt.activation.top, []).append(attempt)
            if attempt.activation.tolerant:
                graph_run.outcome.recovery_failures.append((attempt.node.path, attempt.error))
            elif self.stopping or not (attempt.stopped and isinstance(attempt.error, CancelledError)):
                graph_run.outcome.record_failure(attempt.node.path, attempt.error)
        fatal = next((a.error for a in failed if isinstance(a.error, FATAL)), None)
        if fatal is not None:
            graph_run.fail(fatal)
            return
        failed_itself = {top for top, found in by_activation.items() if any(a.cancelled != SIBLING for a in found)}
        ending = any(graph_run.activations[top].ends_run for top in failed_itself if top in graph_run.activations)
        for top, attempts in sorted(by_activation.items()):
            activation = graph_run.activations.get(top)
            if activation is None:
                continue
            if activation.tolerant:
                for attempt in attempts:
                    activation.skip(attempt)
            elif self.stopping is None and (top in failed_itself or not ending):
                graph_run.leave(activation, activation.subgraph.on_error, failed=True)
