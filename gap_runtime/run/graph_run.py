"""The top level of a run: which subgraphs are being passed through, what they produced, and how the run ends."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from itertools import count
from threading import Event
from time import monotonic
from typing import Any, Literal

from gap_runtime.contracts.failures import CancelledError, PrivilegedReadError, SimulationDivergedError
from gap_runtime.errors import ExecutionError
from gap_runtime.graph.compiled import CompiledGraph, CompiledSubgraph, TopNode
from gap_runtime.run.activation import ReadyQueue, SubgraphActivation
from gap_runtime.run.attempt import Attempt
from gap_runtime.run.events import Emitter
from gap_runtime.run.services import Services
from gap_runtime.run.streaming import Observations, stop_streaming
from gap_runtime.run.superstep import SIBLING
from gap_runtime.safety.protective_stop import stop_arms

FATAL = (PrivilegedReadError, SimulationDivergedError)
Status = Literal["success", "failure", "error", "cancelled"]
CheckpointEvaluator = Callable[[str, str, str], list[str]]
"""(subgraph node, its definition's name, exit) -> names of `validate` checkpoints that do not hold."""


@dataclass
class Outcome:
    """What is known about a run so far, and, once it is over, how it ended."""

    status: Status = "error"
    end: str = ""
    exits: list[tuple[str, str]] = field(default_factory=list)
    failures: list[tuple[str, BaseException]] = field(default_factory=list)
    recovery_failures: list[tuple[str, BaseException]] = field(default_factory=list)
    error: str = ""
    failed_node: str = ""
    visits: dict[str, int] = field(default_factory=dict)
    compute_s: float = 0.0

    def record_failure(self, path: str, error: BaseException) -> None:
        """Something failed at `path`; the first to fail since a subgraph was entered is the one that is named."""
        self.failures.append((path, error))
        if not self.failed_node:
            self.failed_node, self.error = path, str(error) or type(error).__name__


class GraphRun:
    """Activations by top-level index, and the values that flow between them by name."""

    def __init__(
        self, graph: CompiledGraph, services: Services, emitter: Emitter, checkpoints: CheckpointEvaluator | None
    ) -> None:
        self.graph, self.services, self.emitter = graph, services, emitter
        self.outcome = Outcome()
        self.activations: dict[int, SubgraphActivation] = {}
        self.recovering = False
        self.recovery_began = 0.0
        self.over = Event()
        self._checkpoints, self._ids = checkpoints, count(1)
        self._queue = ReadyQueue(graph.nodes)
        self._queue.activate(graph.entries)
        self._values: dict[str, tuple[int, Any]] = {}
        self._observations = Observations(services, graph.workflow.meta.get("observation_stream_hz", ""), graph.dry)

    @property
    def has_pending(self) -> bool:
        """True when a subgraph or an end was reached and not entered yet."""
        return bool(self._queue.pending)

    @property
    def fails_next(self) -> bool:
        """True when a failure end was reached, which does not wait for what runs beside it."""
        return any(self.graph.nodes[i].status == "failure" for i in self._queue.pending)

    def in_order(self) -> list[SubgraphActivation]:
        """The activations, by name of their node."""
        return [self.activations[i] for i in sorted(self.activations)]

    def enter_ready(self) -> None:
        """Enter every subgraph, or the end, that was reached and need not wait. Raises `ExecutionError`."""
        pending = self._queue.pending
        failure = next((i for i in sorted(pending) if self.graph.nodes[i].status == "failure"), None)
        if failure is not None:  # a failure does not wait for what runs beside it
            self._end(self.graph.nodes[failure])
            return
        ready = self._queue.pop_ready(sum(1 << i for i in self.activations))
        subgraphs = [i for i in ready if self.graph.nodes[i].subgraph is not None]
        for index in subgraphs:
            self._enter(self.graph.nodes[index])
        ends = [i for i in ready if self.graph.nodes[i].subgraph is None]
        if ends and not self.activations:
            self._end(self.graph.nodes[ends[0]])
        else:
            self._queue.activate(ends)

    def finish_idle(self, busy: Collection[int]) -> bool:
        """Leave every activation with nothing left to run that is not `busy`; False where nothing moves on."""
        idle = [f for f in self.in_order() if not f.queue.pending and f.top not in busy]
        for activation in idle:
            if activation.top in self.activations:
                self._finish(activation)
        return bool(idle)

    def leave(self, activation: SubgraphActivation, value: str, *, failed: bool) -> None:
        """An activation is over with this exit value; plain edges are for success. Raises `ExecutionError` where
        nothing follows."""
        node = self.graph.nodes[activation.top]
        outputs = {} if failed else activation.outputs()
        self._drop(activation, value, outputs, failed=failed)
        for name, output in outputs.items():
            self._produce(node, name, output)
        targets = [*(() if failed else node.successors), *(node.routes.targets.get(value, ()) if node.routes else ())]
        if not targets:
            raise ExecutionError(f"{node.name} ended with {value!r}, which leads nowhere.", ())
        self._queue.activate(targets)

    def record(self, attempt: Attempt, *, stopping: bool) -> None:
        """Keep what an attempt failed of, unless it only was stopped by a failure beside it."""
        assert attempt.error is not None
        if attempt.activation.tolerant:
            self.outcome.recovery_failures.append((attempt.path, attempt.error))
        elif stopping or not (attempt.stopped and isinstance(attempt.error, CancelledError)):
            self.outcome.record_failure(attempt.path, attempt.error)

    def leave_failed(self, failed: Sequence[Attempt], *, stopping: bool) -> None:
        """Route each activation with a failure of its own to its `on_error`; a recovery only moves on. One that was
        stopped by a failure beside it is dropped with the end that this leads to."""
        by_activation: dict[int, list[Attempt]] = {}
        for attempt in failed:
            by_activation.setdefault(attempt.activation.top, []).append(attempt)
            self.record(attempt, stopping=stopping)
        fatal = next((a.error for a in failed if isinstance(a.error, FATAL)), None)
        if fatal is not None:
            self.fail(fatal)
            return
        failed_itself = {top for top, found in by_activation.items() if any(a.cancelled != SIBLING for a in found)}
        ending = any(self.activations[top].ends_run for top in failed_itself if top in self.activations)
        for top, attempts in sorted(by_activation.items()):
            activation = self.activations.get(top)
            if activation is None:
                continue
            if activation.tolerant:
                for attempt in attempts:
                    activation.skip(attempt)
            elif not stopping and (top in failed_itself or not ending):
                self.leave(activation, activation.subgraph.on_error, failed=True)

    def abort(self, status: Status, reason: str) -> None:
        """End the run here: `on_error` of what runs, then the failure end's recovery, then the end. Never twice."""
        if self.over.is_set():
            return
        self.outcome.status, self.outcome.error = status, reason
        ends = [e for f in self.in_order() if (e := self._failure_end(f)) is not None]
        ends += [n for n in self.graph.nodes if n.status == "failure"]
        for activation in self.in_order():
            self._drop(activation, activation.subgraph.on_error, {}, failed=True)
        if self.recovering or not ends or self._stop_failed():
            self.close()
            return
        self.outcome.end = ends[0].name
        self._recover(ends[0])

    def fail(self, error: BaseException) -> None:
        """End the run at once: nothing can be trusted to recover it."""
        self.outcome.status, self.outcome.error = "error", str(error) or type(error).__name__
        if not any(error is known for _, known in self.outcome.failures):
            self.outcome.failures.append(("", error))
        self.close()

    def close(self) -> None:
        """Drop what is left and say that the run is over. Idempotent."""
        for activation in self.in_order():
            stop_streaming(self.services, activation)
        self.activations.clear()
        self._observations.close()
        self.over.set()

    def _enter(self, node: TopNode) -> None:
        assert node.subgraph is not None
        self.outcome.failed_node = self.outcome.error = ""  # what failed before has been dealt with
        visit = self.outcome.visits[node.name] = self.outcome.visits.get(node.name, 0) + 1
        self._values = {k: v for k, v in self._values.items() if v[0] != node.index}  # a new pass, new outputs
        inputs = {name: self._values[name][1] for name in node.subgraph.inputs if name in self._values}
        activation = self._activate(node, node.subgraph, inputs)
        activation.ends_run = self._failure_end(activation) is not None
        self.emitter.emit("subgraph_entered", node.name, inputs=inputs, visit=visit)

    def _activate(self, node: TopNode, subgraph: CompiledSubgraph, inputs: dict[str, Any]) -> SubgraphActivation:
        made = SubgraphActivation(node.index, node.name, subgraph, inputs, self._observations.stream, self._ids)
        self.activations[node.index] = made
        return made

    def _finish(self, activation: SubgraphActivation) -> None:
        if activation.subgraph.tolerant:
            self.close()
            return
        try:
            value = activation.exit()
            broken = self._checkpoints(activation.name, activation.subgraph.ref, value) if self._checkpoints else []
            if broken:
                raise ExecutionError(f"{activation.name} does not hold what it promised: {', '.join(broken)}.", ())
        except Exception as error:
            self.outcome.record_failure(activation.name, error)
            self.leave(activation, activation.subgraph.on_error, failed=True)
        else:
            self.leave(activation, value, failed=False)

    def _drop(
        self,
        activation: SubgraphActivation,
        value: str,
        outputs: dict[str, Any],
        *,
        failed: bool,
        stopped: bool = False,
    ) -> None:
        """Forget the activation. One that was `stopped` by what happened beside it has not ended by any exit."""
        streamers = stop_streaming(self.services, activation)
        del self.activations[activation.top]
        if activation.subgraph.tolerant:
            return
        if not stopped:
            self.outcome.exits.append((activation.name, value))
        for attempt in streamers:
            self.emitter.attempt_ended(attempt)
        ended = {"exit": value, "failed": failed, "stopped": stopped, "outputs": outputs}
        self.emitter.emit("subgraph_exited", activation.name, **ended)

    def _produce(self, node: TopNode, name: str, value: Any) -> None:
        producer = self._values.get(name, (node.index, None))[0]
        if producer != node.index:
            raise ExecutionError(f"{node.name} and {self.graph.nodes[producer].name} both produce {name!r}.", ())
        self._values[name] = (node.index, value)

    def _failure_end(self, activation: SubgraphActivation) -> TopNode | None:
        routes = self.graph.nodes[activation.top].routes
        targets = routes.targets.get(activation.subgraph.on_error, ()) if routes else ()
        return next((self.graph.nodes[t] for t in targets if self.graph.nodes[t].status == "failure"), None)

    def _end(self, node: TopNode) -> None:
        self.outcome.end, self.outcome.status = node.name, node.status or "success"
        for activation in self.in_order():
            self._drop(activation, activation.subgraph.on_error, {}, failed=True, stopped=True)
        self._recover(node)

    def _recover(self, node: TopNode) -> None:
        self._queue.pending.clear()
        if node.recovery is None:
            self.close()
            return
        self.recovering, self.recovery_began = True, monotonic()
        self.emitter.emit("recovery_started", node.name)
        self._activate(node, node.recovery, {})

    def _stop_failed(self) -> bool:
        problems = stop_arms(self.services.cell)
        if problems:
            self.outcome.failures.append(("", ExecutionError("; ".join(problems), (), hint="Stop the robot by hand.")))
        return bool(problems)
