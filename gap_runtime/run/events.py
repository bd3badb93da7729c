"""What happens while a graph runs, as events. Console, MCAP, HTML, journal and metrics are observers of these.

Observers can neither change what happens nor, unless they are `essential`, stop it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import monotonic
from types import MappingProxyType
from typing import Any, Literal

from gap_runtime.contracts.cell import Cell
from gap_runtime.run.attempt import Attempt

log = logging.getLogger(__name__)

EventKind = Literal[
    "run_started", "subgraph_entered", "node_started", "node_finished", "node_failed", "node_cancelled",
    "tool_called", "tool_returned", "published", "subgraph_exited", "recovery_started", "run_finished",
]  # fmt: skip


@dataclass(frozen=True)
class Event:
    """One transition. `seq` orders them; `t` is monotonic seconds since the run began (never in canonical files);
    `cell_time` is cell time [s] where known. `path` is `subgraph_node/node`, '' for the run. `data` is read-only."""

    seq: int
    t: float
    kind: EventKind
    path: str
    cell_time: float | None = None
    data: Mapping[str, Any] = field(default_factory=dict)


Observer = Callable[[Event], None]


class Emitter:
    """Numbers events and hands them to each observer in turn. False when nobody listens."""

    def __init__(self, observers: Sequence[Observer], cell: Cell | None) -> None:
        self._observers = list(observers)
        self._cell = cell
        self._start = monotonic()
        self._seq = 0
        self.essential_errors: list[Exception] = []

    def __bool__(self) -> bool:
        return bool(self._observers)

    def emit(self, kind: EventKind, path: str, /, **data: Any) -> None:
        """Send one event. An observer that raises is dropped; if it is `essential` the run ends with its error."""
        if not self._observers:
            return
        cell_time = None if self._cell is None else self._cell.time
        event = Event(self._seq, monotonic() - self._start, kind, path, cell_time, MappingProxyType(data))
        self._seq += 1
        for observer in tuple(self._observers):
            try:
                observer(event)
            except Exception as error:
                self._observers.remove(observer)
                if getattr(observer, "essential", False):
                    self.essential_errors.append(error)
                    raise
                log.warning("observer %r dropped: %s", observer, error)

    def attempt_ended(self, attempt: Attempt) -> None:
        """The buffered tool calls of a node, then how it ended. `began` is in seconds since the run began."""
        path = attempt.node.path
        for name, start, data in attempt.calls or ():
            began = start - self._start
            rest = {k: v for k, v in data.items() if k not in ("inputs", "tool")}
            self.emit("tool_called", path, tool=name, began=began, inputs=MappingProxyType(data["inputs"]))
            self.emit("tool_returned", path, tool=name, began=began, **rest)
        numbers = {
            "attempt": attempt.id,
            "inputs": MappingProxyType(attempt.inputs),
            "began": attempt.started - self._start if attempt.started else None,
            "duration_s": max(0.0, attempt.ended - attempt.started) if attempt.started else 0.0,
            "compute_s": attempt.compute_s,
            "send": attempt.send and attempt.send[1],
        }
        if attempt.error is None:
            self.emit("node_finished", path, output=attempt.value, **numbers)
        elif attempt.stopped:
            self.emit("node_cancelled", path, error=attempt.error, reason=attempt.cancelled, **numbers)
        else:
            self.emit("node_failed", path, error=attempt.error, **numbers)
