"""One pass through one subgraph: which nodes are ready, what they produced, and how the pass ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from gap_runtime.contracts.failures import ToolError, UnknownNameError
from gap_runtime.errors import ExecutionError
from gap_runtime.graph.compiled import UNSET, CompiledNode, CompiledStep, CompiledSubgraph, Routes
from gap_runtime.graph.references import walk
from gap_runtime.run.attempt import Attempt
from gap_runtime.run.streams import Stream


class ReadyQueue:
    """Steps that were reached and have not run; one waits while another of them, or `busy`, can still lead to it."""

    __slots__ = ("_steps", "pending", "visits")

    def __init__(self, steps: Sequence[CompiledStep]) -> None:
        self._steps = steps
        self.pending: dict[int, None] = {}
        self.visits: dict[int, int] = {}

    def activate(self, indices: Sequence[int]) -> None:
        """Control arrives at these steps."""
        for index in indices:
            self.pending[index] = None

    def pop_ready(self, busy: int = 0) -> list[int]:
        """The steps that may run now, in order. Raises `ExecutionError` where they wait for each other."""
        pending = self.pending
        if len(pending) == 1 and not busy:
            ready = list(pending)
            pending.clear()
        else:
            ready = self._not_waiting(busy)
        for index in ready:
            if self._steps[index].looped:
                self._count(index)
        return ready

    def _not_waiting(self, busy: int) -> list[int]:
        ahead = busy
        for index in self.pending:
            ahead |= 1 << index
        ready = sorted(i for i in self.pending if not self._steps[i].waits_for & ahead)
        if not ready and not busy and self.pending:
            names = ", ".join(sorted(self._steps[i].name for i in self.pending))
            raise ExecutionError(f"Nodes {names} wait for each other.", ())
        for index in ready:
            del self.pending[index]
        return ready

    def _count(self, index: int) -> None:
        step = self._steps[index]
        self.visits[index] = self.visits.get(index, 0) + 1
        if self.visits[index] > step.max_visits:
            raise ExecutionError(
                f"{step.path} was reached more than {step.max_visits} times.", (),
                hint="Raise its max_visits if it is meant to loop that long.",
            )  # fmt: skip


class SubgraphActivation:
    """The state of one pass. `slots` holds each node's output by index; `sends` what a router wants run, by target."""

    __slots__ = (
        "ends_run", "ids", "inputs", "name", "observations", "queue", "sends", "slots", "streamers", "streams",
        "subgraph", "terminals", "top",
    )  # fmt: skip

    def __init__(
        self, top: int, name: str, subgraph: CompiledSubgraph, inputs: Mapping[str, Any],
        observations: Callable[[], Stream], ids: Iterator[int],
    ) -> None:  # fmt: skip
        self.top, self.name, self.subgraph, self.inputs = top, name, subgraph, inputs
        self.observations, self.ids = observations, ids
        self.slots: list[Any] = [UNSET] * len(subgraph.nodes)
        self.queue = ReadyQueue(subgraph.nodes)
        self.queue.activate(subgraph.entries)
        self.sends: dict[int, list[tuple[int, int, Mapping[str, Any]]]] = {}
        self.streams: dict[int, Stream] = {}
        self.streamers: list[Attempt] = []
        self.terminals: list[CompiledNode] = []
        self.ends_run = False  # a failure here ends the whole run

    def ready(self, busy: int = 0) -> list[Attempt]:
        """An attempt for every node that may run now; several for one that a router sends several inputs. `busy` nodes
        still run, and what they can lead to waits."""
        attempts: list[Attempt] = []
        for index in self.queue.pop_ready(busy):
            node = self.subgraph.nodes[index]
            sends = self.sends.pop(index, None) if self.sends else None
            if sends is None:
                attempts.append(Attempt(next(self.ids), node, self))
                continue
            for router, place, inputs in sends:
                attempt = Attempt(next(self.ids), node, self)
                attempt.extra, attempt.send = inputs, (router, place)
                attempts.append(attempt)
        return attempts

    @property
    def tolerant(self) -> bool:
        """True for a recovery: an error is recorded and the next node runs."""
        return self.subgraph.tolerant

    def skip(self, attempt: Attempt) -> None:
        """Move on without an output."""
        self.queue.activate(attempt.node.successors)

    def commit(self, attempt: Attempt) -> None:
        """Take over the output and move on. Raises `ExecutionError` or `ToolError` where its routing leads nowhere."""
        node = attempt.node
        if attempt.send is not None:
            router, place = attempt.send
            self.slots[router][place] = attempt.value
        else:
            self.slots[node.index] = attempt.value
        self.queue.activate(node.successors)
        if node.ends:
            self.terminals.append(node)
        if node.routes is not None:
            self._route(node, node.routes, attempt.value)

    def _route(self, node: CompiledNode, routes: Routes, value: Any) -> None:
        if node.kind == "router" and not isinstance(value, str) and isinstance(value, Sequence):
            self._send(node, routes, value)
            return
        key = route_key(walk(value, routes.fields, node.path) if routes.fields else value)
        targets = routes.targets.get(key)
        if targets is None:
            targets = self._named(node, routes, key)
        if key in routes.ends:
            self.terminals.append(node)
        self.queue.activate(targets)

    def _named(self, node: CompiledNode, routes: Routes, key: str) -> tuple[int, ...]:
        """A router may name the node itself."""
        for targets in routes.targets.values():
            if node.kind == "router" and any(self.subgraph.nodes[t].name == key for t in targets):
                return targets
        raise ToolError(
            "route",
            f"{node.path} gave {key!r}, which leads nowhere.",
            hint=f"It can give: {', '.join(routes.targets)}.",
        )

    def _send(self, router: CompiledNode, routes: Routes, sends: Sequence[Any]) -> None:
        targets = {self.subgraph.nodes[t].name: t for ts in routes.targets.values() for t in ts}
        self.slots[router.index] = [UNSET] * len(sends)
        for place, send in enumerate(sends):
            to, inputs = _send_parts(send, router.path)
            if to not in targets:
                raise UnknownNameError(f"node (sent to by {router.path})", to, targets)
            self.sends.setdefault(targets[to], []).append((router.index, place, inputs))
            self.queue.activate((targets[to],))
        if not sends:
            if len(targets) != 1:
                raise ToolError("route", f"{router.path} sent nothing and has several targets; return a node's name.")
            self.queue.activate(self.subgraph.nodes[next(iter(targets.values()))].successors)

    def exit(self) -> str:
        """The exit value of a pass with nothing left to run. Raises `ExecutionError` where it has none, or several."""
        subgraph = self.subgraph
        names: set[str] = set()
        for node in self.terminals:
            if subgraph.exit_fields is None:
                names.add(node.name)
            else:
                names.add(route_key(walk(self.slots[node.index], subgraph.exit_fields, node.path)))
        found = sorted(names & subgraph.success_values)
        if len(found) == 1:
            return found[0]
        known = f"Its exits are: {', '.join(sorted(subgraph.success_values))}."
        if found:
            raise ExecutionError(f"{self.name} reached several exits: {', '.join(found)}.", (), hint=known)
        raise ExecutionError(
            f"{self.name} ended without an exit ({', '.join(sorted(names)) or 'nothing'}).", (), hint=known
        )

    def outputs(self) -> dict[str, Any]:
        """The subgraph's outputs, without those whose node did not run on this path."""
        found: dict[str, Any] = {}
        for name, read in self.subgraph.outputs:
            try:
                found[name] = read(self, None)
            except ToolError:
                continue  # who reads it says so
        return found


def route_key(value: Any) -> str:
    """A deciding value as conditional edges spell it: `true`, `false`, or its text."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _send_parts(send: Any, where: str) -> tuple[str, Mapping[str, Any]]:
    if hasattr(send, "_asdict"):
        send = send._asdict()
    if not isinstance(send, Mapping) or set(send) - {"to", "inputs"} or not isinstance(send.get("to"), str):
        raise ToolError("route", f"{where} must send {{'to': node, 'inputs': {{...}}}}, not {send!r:.80}")
    inputs = send.get("inputs", {})
    if not isinstance(inputs, Mapping):
        raise ToolError("route", f"{where} must send inputs by name")
    return send["to"], inputs
