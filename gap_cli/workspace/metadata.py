"""What git does not see of a run: meta.json and timings.jsonl (when, where, how long), pictures and recordings."""

from __future__ import annotations

import platform
import time
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gap_cli.workspace.canonical import write_json, write_jsonl
from gap_cli.workspace.run import Run
from gap_runtime.contracts.documents import read_json
from gap_runtime.errors import DocumentError

SCHEMA = "gap/meta/v1"


def read_meta(run: Run) -> dict[str, Any]:
    """What meta.json says; empty where it is missing or damaged, since nothing depends on it."""
    try:
        data = read_json(run.path / "meta.json")
    except DocumentError:
        return {}
    return data if isinstance(data, dict) else {}


def record_stage(run: Run, stage: str, started: float, **values: Any) -> None:
    """Record when `stage` was done, how long it took since `started` (monotonic seconds), on which machine, and
    `values`. Raises `StorageError`."""
    from gap_cli import __version__

    before = read_meta(run).get("stages")
    stages: dict[str, Any] = before if isinstance(before, dict) else {}
    clock = {"at": datetime.now(UTC).isoformat(timespec="seconds"), "seconds": time.monotonic() - started}
    stages = {**stages, stage: {**clock, **values}}
    host = {"machine": platform.machine(), "system": platform.platform(), "python": platform.python_version()}
    write_json(run.path / "meta.json", {"schema": SCHEMA, "engine": __version__, "host": host, "stages": stages})


def write_timings(run: Run, stage: str, rows: Iterable[dict[str, Any]]) -> None:
    """Write `<stage>/timings.jsonl`: measured seconds, one row per episode. Raises `StorageError`."""
    write_jsonl(run.folder(stage) / "timings.jsonl", rows)


def frame_path(folder: Path, seed: int, which: str) -> Path:
    """Where the `first` or `last` frame of a seed goes."""
    return folder / "frames" / f"seed-{seed:06d}-{which}.png"


def recording_path(folder: Path, seed: int) -> Path:
    """Where the recording of a seed goes."""
    return folder / f"seed-{seed:06d}.mcap"
