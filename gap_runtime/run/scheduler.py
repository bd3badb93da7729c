"""Plans, executes and commits super-steps until the graph has reached an end."""

from __future__ import annotations

import random

from gap_runtime.contracts.failures import CancelledError, PrivilegedReadError, SimulationDivergedError
from gap_runtime.errors import ExecutionError
from gap_runtime.run.activation import Frame
from gap_runtime.run.attempt import SETTLED, Attempt
from gap_runtime.run.context import Services
from gap_runtime.run.events import Emitter
from gap_runtime.run.graph_run import Course, Status
from gap_runtime.run.pool import Pool
from gap_runtime.run.streaming import start_streaming
from gap_runtime.run.superstep import SIBLING, Abandoned, ParallelStep, SuperStep
from gap_runtime.safety.protective_stop import stop_arms

FATAL = (PrivilegedReadError, SimulationDivergedError)


class Scheduler:
    """Drives a `Course`. `loop` may be given up in the middle of a node and taken up again by another thread."""

    def __init__(
        self, course: Course, pool: Pool, *, lockstep: bool, shuffle: random.Random | None, world_deadline: float | None
    ) -> None:
        self.course, self.pool = course, pool
        self.services: Services = course.services
        self.emitter: Emitter = course.emitter
        self.step: SuperStep | None = None
        self.stopping: tuple[Status, str] | None = None  # set by the supervisor
        self.hurry = False  # set by the supervisor: no recovery, or no more of it
        self._streams = False  # whether any streaming node has been started
        self._lockstep, self._shuffle, self._world_deadline = lockstep, shuffle, world_deadline

    def loop(self) -> None:
        """Run until the course is over, or until this thread is given up."""
        over = self.course.over
        try:
            while not over.is_set():
                try:
                    step = self.step or self._plan()
                    if step is not None:
                        step.run(self.services, self.pool)
                        self._commit(step)
                except ExecutionError as error:
                    self.course.outcome.failures.append(("", error))
                    self.course.abort("error", str(error))
        except Abandoned:
            return
        except BaseException as error:
            stop_arms(self.services.cell)
            self.course.fail(error)

    def _plan(self) -> SuperStep | None:
        """The next super-step; None where the course moved on without one."""
        course = self.course
        if self.hurry:
            course.close()
        elif not course.recovering and self._cut_short():
            return None
        if course.has_due:
            course.enter_due()
        attempts = self._attempts()
        if not attempts:
            if broken := self._broken_streams():
                stop_arms(self.services.cell)
                self._leave_failed(broken)
            elif not course.over.is_set():
                course.finish_idle()
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
        """What may run now; nothing while a frame is to be left, since what follows it is not to wait for the rest."""
        frames = self.course.in_order()
        if len(frames) == 1:
            return self._ready(frames[0])
        return [a for f in frames for a in self._ready(f)] if all(f.due.pending for f in frames) else []

    def _cut_short(self) -> bool:
        cell = self.services.cell
        if self.stopping is not None:
            self.course.abort(*self.stopping)
        elif cell is not None and self._world_deadline is not None and cell.time > self._world_deadline:
            self.course.abort("error", "The task's time is up.")
        else:
            return False
        return True

    def _ready(self, frame: Frame) -> list[Attempt]:
        ready = frame.ready()
        if not frame.subgraph.streams:
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
        step.overrule()
        failed = False
        looked, moved = 0.0, 0.0
        for attempt in step.attempts:
            if attempt.error is None and attempt.state is SETTLED:
                try:
                    attempt.frame.commit(attempt)
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
        self.course.outcome.compute_s += looked + moved
        broken = self._broken_streams() if self._streams else []
        problems = stop_arms(self.services.cell) if failed or broken else []
        for attempt in step.attempts:
            if attempt.node.effect != "pure":
                self.services.leases.release(attempt)
            if self.emitter:
                self.emitter.attempt_ended(attempt)
        if problems:
            self.course.fail(ExecutionError("; ".join(problems), (), hint="Stop the robot by hand."))
        elif failed or broken:
            self._leave_failed([*broken, *(a for a in step.attempts if a.error is not None)])

    def _broken_streams(self) -> list[Attempt]:
        return [s for f in self.course.frames.values() for s in f.streamers if s.error is not None]

    def _leave_failed(self, failed: list[Attempt]) -> None:
        """Route each frame with a failure of its own to its `on_error`; a recovery only moves on. One that was stopped
        by a failure beside it is dropped with the end that this leads to."""
        course = self.course
        by_frame: dict[int, list[Attempt]] = {}
        for attempt in failed:
            assert attempt.error is not None
            by_frame.setdefault(attempt.frame.top, []).append(attempt)
            if attempt.frame.subgraph.tolerant:
                course.outcome.recovery_failures.append((attempt.node.path, attempt.error))
            elif self.stopping or not (attempt.stopped and isinstance(attempt.error, CancelledError)):
                course.outcome.note(attempt.node.path, attempt.error)
        fatal = next((a.error for a in failed if isinstance(a.error, FATAL)), None)
        if fatal is not None:
            course.fail(fatal)
            return
        failed_itself = {top for top, found in by_frame.items() if any(a.cancelled != SIBLING for a in found)}
        ending = any(course.frames[top].ends_run for top in failed_itself if top in course.frames)
        for top, attempts in sorted(by_frame.items()):
            frame = course.frames.get(top)
            if frame is None:
                continue
            if frame.subgraph.tolerant:
                for attempt in attempts:
                    frame.due.reach(attempt.node.successors)
            elif self.stopping is None and (top in failed_itself or not ending):
                course.leave(frame, frame.subgraph.on_error, failed=True)
