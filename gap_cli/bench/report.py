"""A benchmark's tables for people and for programs, with the command, the machine and the versions behind it."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from gap_cli import __version__
from gap_runtime.contracts.bench import BenchReport

SCHEMA = "gap/bench/v1"


def as_data(name: str, report: BenchReport, command: str = "") -> dict[str, Any]:
    """Plain data: the tables, and what is needed to believe them."""
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "benchmark": name,
        "command": command or f"gap bench {name}",
        "title": report.title,
        "columns": list(report.columns),
        "rows": [list(row) for row in report.rows],
    }
    if report.more:
        data["more"] = [
            {"title": t.title, "columns": list(t.columns), "rows": [list(row) for row in t.rows]} for t in report.more
        ]
    if report.pictures:
        captions = [picture.caption for picture in report.pictures]
        data["pictures"] = [
            {"file": file, "caption": c} for file, c in zip(picture_files(name, report), captions, strict=True)
        ]
    return data | {"notes": list(report.notes), "machine": machine(), "lock": lock(report.packages)}


def picture_files(name: str, report: BenchReport) -> dict[str, bytes]:
    """The pictures by file name: the benchmark's, numbered where there are several."""
    single = len(report.pictures) == 1
    return {
        f"{name}{'' if single else f'-{i}'}{picture.suffix}": picture.data for i, picture in enumerate(report.pictures)
    }


def markdown(data: dict[str, Any]) -> str:
    """The tables and pictures as Markdown, ready to be quoted."""
    parts = [f"# {data['title']}", "", *_table(data), ""]
    for table in data.get("more", ()):
        parts += [f"## {table['title']}", "", *_table(table), ""]
    for picture in data.get("pictures", ()):
        parts += [f"![{picture['caption']}]({picture['file']})", ""]
    return "\n".join([*parts, *_facts(data)]) + "\n"


def _table(data: dict[str, Any]) -> list[str]:
    head = f"| {' | '.join(data['columns'])} |"
    align = "|" + "|".join("---" if _is_text(data, i) else "---:" for i in range(len(data["columns"]))) + "|"
    return [head, align, *(f"| {' | '.join(_cell(v) for v in row)} |" for row in data["rows"])]


def _facts(data: dict[str, Any]) -> list[str]:
    facts = [f"- {note}" for note in data["notes"]]
    facts += [f"- Command: `{data['command']}`", "- Machine: " + ", ".join(str(v) for v in data["machine"].values())]
    return [*facts, "- Versions: " + ", ".join(f"{k} {v}" for k, v in data["lock"].items())]


def machine() -> dict[str, Any]:
    """What it was measured on; nothing that names the machine."""
    return {
        "processor": _processor(),
        "cores": f"{len(os.sched_getaffinity(0))} cores",
        "system": f"{platform.system()} {platform.release().partition('-')[0]} {platform.machine()}",
        "python": f"Python {platform.python_version()}",
    }


def lock(packages: tuple[str, ...]) -> dict[str, str]:
    """Versions of the engine and of `packages`; 'not installed' where one is not."""
    found = {"gap-cli": __version__, "numpy": metadata.version("numpy")}
    for name in packages:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def _is_text(data: dict[str, Any], column: int) -> bool:
    return any(isinstance(row[column], str) for row in data["rows"])


def _cell(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value).replace("|", "\\|")
