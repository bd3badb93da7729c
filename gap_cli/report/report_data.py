"""Gathers what a run's folder holds into what its page shows."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gap_cli.workspace.metadata import frame_path, read_meta, recording_path
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import PRODUCT, product
from gap_runtime.contracts.documents import parse_json, read_json, read_text

REHEARSAL = "rehearse/00"
JPEG_QUALITY = 78
Row = Mapping[str, Any]


def read_optional(path: Path) -> Any:
    """A JSON file's content, or None where the stage that writes it has not run. Raises `DocumentError`."""
    return read_json(path) if path.is_file() else None


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a .jsonl file; none where there is no file. Raises `DocumentError`."""
    if not path.is_file():
        return []
    return [parse_json(line, f"{path}:{i}") for i, line in enumerate(read_text(path).splitlines(), 1)]


def gather(run: Run) -> dict[str, Any]:
    """Everything the template needs that is read, not drawn. Raises `RunError` before `gap generate`."""
    product(run, "generate")
    folder = run.folder(REHEARSAL)
    summary = read_optional(run.path / PRODUCT["rehearse"])
    rows = read_rows(folder / "episodes.jsonl") if summary else []
    timings = {t["seed"]: t for t in read_rows(folder / "timings.jsonl")} if summary else {}
    lock = read_optional(run.path / "lock.json") or {}
    return {
        "name": run.name, "config": run.config, "plan": read_optional(run.path / PRODUCT["plan"]) or {},
        "summary": summary, "rows": rows, "lock": lock, "stages": read_meta(run).get("stages", {}),
        "clock": read_meta(run).get("stages", {}).get("rehearse", {}),
        "episodes": [episode(row, timings.get(row["seed"], {}), folder) for row in sorted(rows, key=_failures_first)],
        "split": time_split(summary, rows, timings) if summary else [],
        "serving": serving(summary, lock),
    }  # fmt: skip


def episode(row: Row, timing: Row, folder: Path) -> dict[str, Any]:
    """One episode with its pictures."""
    recording = recording_path(folder, row["seed"])
    return {
        **row, "timing": timing,
        "first": picture(frame_path(folder, row["seed"], "first")),
        "last": picture(frame_path(folder, row["seed"], "last")),
        "recording": recording.relative_to(folder.parents[1]) if recording.is_file() else "",
    }  # fmt: skip


def picture(path: Path) -> str:
    """A picture as a data URI, re-encoded small; '' where there is none."""
    if not path.is_file():
        return ""
    import cv2

    image = cv2.imread(str(path))
    if image is None:
        return ""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode("ascii")


def time_split(summary: Row, rows: Sequence[Row], timings: Mapping[int, Row]) -> list[dict[str, Any]]:
    """Mean seconds of each subgraph over successful episodes: motion in the simulator, and measured compute."""
    won = [row for row in rows if row["success"]]
    found = []
    for about in summary["subgraphs"] if won else ():
        name = about["node"]
        motion = sum(v["motion_s"] for row in won for v in row["subgraphs"] if v["node"] == name)
        nodes = [timings.get(row["seed"], {}).get("nodes", {}) for row in won]
        compute = sum(s for by in nodes for path, s in by.items() if path.partition("/")[0] == name)
        found.append({"node": name, "motion_s": motion / len(won), "compute_s": compute / len(won)})
    return found


def serving(summary: Row | None, lock: Row) -> list[dict[str, str]]:
    """Who served each tool the graph may call."""
    tools = lock.get("tools", {})
    names = summary["providers"] if summary else tools
    return [
        {"tool": n, "provider": tools[n]["provider"], "plugin": tools[n]["plugin"], "contract": tools[n]["contract"]}
        for n in names
        if n in tools
    ]


def _failures_first(row: Row) -> tuple[bool, int]:
    return bool(row["success"]), row["seed"]
