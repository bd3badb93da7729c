"""An observer that keeps a run's events as plain rows, values in short, for pages and terminals."""

from __future__ import annotations

from typing import Any

from gap_cli.render.preview import preview
from gap_runtime.run.events import Event

SCHEMA = "gap/trace/v1"
STAGE, TRACE = "run", "trace.jsonl"  # where `gap run` keeps its last trace, inside a run's folder
MAX_PICTURED = 400  # events that may hold thumbnails: a page must stay small enough to open


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
        self.rows.append(row if event.world_time is None else {**row, "world_time": round(event.world_time, 6)})
