"""What happens while a graph runs, as events. Console, MCAP, HTML, journal and metrics are observers of these."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

EventKind = Literal[
    "run_started", "subgraph_entered", "node_started", "node_finished", "node_failed", "node_cancelled",
    "tool_called", "tool_returned", "published", "subgraph_exited", "recovery_started", "run_finished",
]  # fmt: skip


@dataclass(frozen=True)
class Event:
    """One transition. `seq` orders them; `t` is monotonic seconds since the run began (never in canonical files);
    `world_time` is world time [s] where known. `path` is `subgraph_node/node`, '' for the run. `data` is read-only."""

    seq: int
    t: float
    kind: EventKind
    path: str
    world_time: float | None = None
    data: Mapping[str, Any] = field(default_factory=dict)


Observer = Callable[[Event], None]
