"""A benchmark's table for people and for programs, with the command, the machine and the versions behind it."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from gap_cli import __version__
from gap_cli.contracts.bench import BenchReport

SCHEMA = "gap/bench/v1"


def as_data(name: str, report: BenchReport) -> dict[str, Any]:
    """Plain data: the table, and what is needed to believe it."""
    return {
        "schema": SCHEMA,
        "benchmark": name,
        "command": f"gap bench {name}",
        "title": report.title,
        "columns": list(report.columns),
        "rows": [list(row) for row in report.rows],
        "notes": list(report.notes),
        "machine": machine(),
        "lock": lock(report.packages),
    }


def markdown(data: dict[str, Any]) -> str:
    """The table as Markdown, ready to be quoted."""
    head = f"| {' | '.join(data['columns'])} |"
    align = "|" + "|".join("---" if _is_text(data, i) else "---:" for i in range(len(data["columns"]))) + "|"
    rows = [f"| {' | '.join(_cell(v) for v in row)} |" for row in data["rows"]]
    facts = [f"- {note}" for note in data["notes"]]
    facts += [f"- Command: `{data['command']}`", "- Machine: " + ", ".join(str(v) for v in data["machine"].values())]
    facts += ["- Versions: " + ", ".join(f"{k} {v}" for k, v in data["lock"].items())]
    return "\n".join([f"# {data['title']}", "", head, align, *rows, "", *facts]) + "\n"


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
