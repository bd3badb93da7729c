"""A run's events as plain rows, and what happened read back from them: every visit of every node, in order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gap_cli.render.preview import preview
from gap_runtime.run.events import Event

SCHEMA = "gap/trace/v1"
STAGE, TRACE = "run", "trace.jsonl"  # where `gap run` keeps its last trace, inside a run's folder
MAX_PICTURED = 400  # events that may hold thumbnails: a page must stay small enough to open
ENDINGS = {"node_finished": "finished", "node_failed": "failed", "node_cancelled": "cancelled"}


class Tracer:
    """Call it with events; `rows` is the trace. It holds wall-clock times, so it is nothing for git."""

    def __init__(self, *, pictures: bool = True) -> None:
        self.rows: list[dict[str, Any]] = [{"schema": SCHEMA}]
        self._pictures = pictures
        if pictures:
            import cv2  # noqa: F401  # now, so that no node waits for it later

    def __call__(self, event: Event) -> None:
        """Keep one event."""
        pictures = self._pictures and len(self.rows) < MAX_PICTURED
        data = {key: preview(value, pictures=pictures) for key, value in event.data.items()}
        row = {"seq": event.seq, "t": round(event.t, 6), "kind": event.kind, "path": event.path, "data": data}
        self.rows.append(row if event.cell_time is None else {**row, "cell_time": round(event.cell_time, 6)})


@dataclass
class Visit:
    """One attempt at a node. Times in seconds since the run began; `data` holds previews of inputs, output, calls."""

    path: str
    callee: str
    start: float
    world_start: float | None
    end: float | None = None
    world_end: float | None = None
    status: str = "running"
    compute_s: float = 0.0
    error: str = ""
    send: int | None = None
    data: dict[str, Any] = field(default_factory=dict)

    @property
    def world_s(self) -> float:
        """World time that passed while it ran."""
        return 0.0 if self.world_start is None or self.world_end is None else self.world_end - self.world_start


@dataclass
class RunTimeline:
    """A run as its trace tells it. `clock` pairs seconds since the start with world time, in order."""

    visits: list[Visit] = field(default_factory=list)
    exits: dict[str, list[str]] = field(default_factory=dict)
    passes: list[dict[str, Any]] = field(default_factory=list)
    clock: list[tuple[float, float]] = field(default_factory=list)
    status: str = ""
    end: str = ""
    error: str = ""
    seed: int | None = None
    duration: float = 0.0

    @property
    def latest(self) -> dict[str, Visit]:
        """The last visit of each node by path."""
        return {visit.path: visit for visit in self.visits}


def read_timeline(rows: Iterable[Mapping[str, Any]]) -> RunTimeline:
    """From the rows of a trace (see `trace.Tracer`)."""
    timeline = RunTimeline()
    open_: dict[Any, Visit] = {}
    for row in rows:
        if "kind" not in row:
            continue
        t, world, data = float(row["t"]), row.get("cell_time"), row.get("data", {})
        timeline.duration = max(timeline.duration, t)
        if world is not None:
            timeline.clock.append((t, float(world)))
        _read(timeline, open_, row["kind"], row["path"], t, world, data)
    return timeline


def _read(
    timeline: RunTimeline,
    open_: dict[Any, Visit],
    kind: str,
    path: str,
    t: float,
    world: float | None,
    data: Mapping[str, Any],
) -> None:
    match kind:
        case "run_started":
            timeline.seed = data.get("seed")
        case "run_finished":
            timeline.status, timeline.end, timeline.error = (
                data.get("status", ""),
                data.get("end", ""),
                data.get("error", ""),
            )
        case "subgraph_entered":
            timeline.passes.append({"name": path, "start": t, "end": None, "exit": ""})
        case "subgraph_exited":
            timeline.exits.setdefault(path, []).append(data.get("exit", ""))
            for entry in reversed(timeline.passes):
                if entry["name"] == path and entry["end"] is None:
                    entry |= {"end": t, "exit": data.get("exit", "")}
                    break
        case "node_started":
            visit = Visit(path, data.get("callee", ""), t, world)
            open_[data.get("attempt")] = visit
            timeline.visits.append(visit)
        case "tool_called" | "tool_returned":
            visit = next(v for v in reversed(timeline.visits) if v.path == path)
            calls = visit.data.setdefault("calls", [])
            if kind == "tool_called":
                calls.append(dict(data))
            elif calls:
                calls[-1] |= data
        case _ if kind in ENDINGS and data.get("attempt") in open_:
            visit = open_.pop(data.get("attempt"))
            visit.status, visit.end, visit.world_end = ENDINGS[kind], t, world
            if data.get("began") is not None:
                visit.start, visit.end = data["began"], data["began"] + data["duration_s"]
            visit.compute_s, visit.send = data.get("compute_s", 0.0), data.get("send")
            visit.error = data.get("error", "") or ""
            visit.data |= {k: data[k] for k in ("inputs", "output", "reason") if k in data}
