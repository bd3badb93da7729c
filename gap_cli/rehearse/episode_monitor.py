"""Watches a graph run with the eyes of the simulator: what each node changed, and which promises each subgraph kept.

An observer of the interpreter's events; its privileged snapshots are taken between nodes, never inside one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gap_cli.rehearse.state_diff import changes
from gap_runtime.contracts.encoding.codec import to_plain
from gap_runtime.contracts.failures import BadRequestError, GapError
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.graph.checkpoints import Checkpoint, evaluate
from gap_runtime.graph.compiled import CompiledGraph
from gap_runtime.run.events import Event


class EpisodeMonitor:
    """Fills `nodes` and `subgraphs`, the two lists of an episode's row, and `computed`, the wall seconds each node
    computed while world time stood still."""

    essential = True  # an episode that was not watched cannot be judged

    def __init__(
        self,
        simulator: Simulator,
        graph: CompiledGraph,
        checkpoints: Mapping[str, tuple[Checkpoint, ...]],
        objects: Sequence[str] = (),
    ) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.subgraphs: list[dict[str, Any]] = []
        self.computed: dict[str, float] = {}
        self.failed: dict[str, str] = {}  # code of the error each failed node ended with
        self._simulator, self._checkpoints, self._objects = simulator, checkpoints, objects
        self._tops = {node.name: node.subgraph for node in graph.nodes if node.subgraph is not None}
        self._before: dict[str, WorldSnapshot] = {}
        self._entered: dict[str, float] = {}
        self._last: WorldSnapshot | None = None

    def __call__(self, event: Event) -> None:
        """Take note of one event."""
        match event.kind:
            case "subgraph_entered":
                self._entered[event.path] = self._simulator.time
            case "node_started":
                self._before[event.path] = self._snapshot()
            case "node_finished" | "node_failed" | "node_cancelled":
                self._node(event)
            case "subgraph_exited":
                self._exit(event)

    def _node(self, event: Event) -> None:
        if event.path not in self._before:
            return
        before = self._before.pop(event.path)
        after = self._snapshot()
        ok = event.kind == "node_finished"
        error = event.data.get("error")
        if not ok:
            self.failed[event.path] = getattr(error, "code", type(error).__name__) if error else event.kind
        self.nodes.append({
            "node": event.path, "ok": ok, "error": "" if ok else message(error), "t": [before.time, after.time],
            "changes": to_plain(changes(before, after)),
        })  # fmt: skip
        self.computed[event.path] = self.computed.get(event.path, 0.0) + event.data.get("compute_s", 0.0)

    def _exit(self, event: Event) -> None:
        subgraph = self._tops.get(event.path)
        if subgraph is None or event.data.get("stopped"):  # by a failure beside it: neither kept nor broken
            return
        name = str(event.data.get("exit", ""))
        points = {p.name: self._checkpoint(p) for p in self._checkpoints.get(subgraph.ref, ())}
        ok = name in subgraph.success_values
        kept = all(point["passed"] for point in points.values() if point["validate"])
        now = self._simulator.time
        self.subgraphs.append({
            "node": event.path, "exit": name, "ok": ok, "passed": ok and kept,
            "motion_s": now - self._entered.pop(event.path, now), "checkpoints": points,
            "state": to_plain(state(self._snapshot(), self._objects)),
        })  # fmt: skip

    def _checkpoint(self, point: Checkpoint) -> dict[str, Any]:
        snapshot = self._snapshot()
        values = {name: _value(expression, snapshot) for name, expression in point.diagnostics.items()}
        return {"passed": _value(point.predicate, snapshot) is True, "validate": point.validate, "values": values}

    def _snapshot(self) -> WorldSnapshot:
        """Ground truth now. Physics moves only while world time passes, so one look per instant is enough."""
        if self._last is None or self._last.time != self._simulator.time:
            self._last = self._simulator.snapshot()
        return self._last


def state(snapshot: WorldSnapshot, objects: Sequence[str]) -> dict[str, Any]:
    """The named objects' positions [m] and contacts, and the jaws' openings [m], for a reader of failures."""
    bodies = {name: snapshot.bodies[name] for name in objects if name in snapshot.bodies}
    found: dict[str, Any] = {
        name: {"position": body.pose.position.array, "contacts": sorted(body.contacts)} for name, body in bodies.items()
    }
    return {**found, **{f"gripper:{i}": arm.gripper_width for i, arm in enumerate(snapshot.arms)}}


def message(error: Any) -> str:
    """The first line of what an error says; its type where it says nothing."""
    text = error.message if isinstance(error, GapError) else str(error or "")
    return text.split("\n")[0] or type(error).__name__


def _value(expression: str, snapshot: WorldSnapshot) -> Any:
    """The expression's value as plain data; what has none says why."""
    try:
        value = evaluate(expression, snapshot)
        if isinstance(value, float) and not math.isfinite(value):
            return str(value)
        return to_plain(value)
    except BadRequestError:
        return type(value).__name__
    except GapError as error:
        return error.message
