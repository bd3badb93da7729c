"""report.html: a run as one self-contained page."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from gap_cli.report.drawing import graph_svg
from gap_cli.report.report_data import gather
from gap_cli.workspace.canonical import write_text
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import product
from gap_runtime.graph.load import load_workflow

PAGE = "report.html"
SHOWN = 100  # episodes with pictures


def write_report(run: Run) -> Path:
    """Write the page and return where it is. Raises `RunError` before `gap generate`, `StorageError`."""
    path = run.path / PAGE
    write_text(path, render(run))
    return path


def render(run: Run) -> str:
    """The page. Nothing in it is fetched from anywhere."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    env = Environment(
        loader=PackageLoader("gap_cli.report", "templates"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    env.filters |= {"pct": lambda x: f"{100 * x:.0f} %", "secs": _seconds}
    material = gather(run)
    summary = material["summary"]
    stats = {s["node"]: s for s in summary["subgraphs"]} if summary else {}
    drawing = graph_svg(load_workflow(product(run, "generate")), stats)
    return env.get_template("report.html.j2").render(
        **material, drawing=drawing, shown=SHOWN, commands=commands(run, summary)
    )


def commands(run: Run, summary: Any) -> list[str]:
    """What to type to get the same episodes again."""
    config = run.config
    rehearse = [f"gap rehearse -n {summary['asked']} --seed {summary['seed']}"] if summary else []
    if run.graph_folder == run.path:  # a graph from elsewhere: there is nothing to generate it from
        return [f"gap validate {run.argument}", *(f"{line} {run.argument}" for line in rehearse)]
    plan = ["gap", "plan", "--task", config.task, "--say", config.instruction]
    plan += ["--variant", config.variant] if config.variant else []
    plan += ["--author", config.author] if config.author != "symbolic" else []
    for tool, provider in config.providers.items():
        plan += ["--provider", f"{tool}={provider}"]
    return [shlex.join(plan), "gap generate", "gap validate", *rehearse]


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} s"
