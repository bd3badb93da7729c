"""One self-contained HTML page: the graph, and, of a run, what every node took, got and gave, on a time line."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gap_cli.render.drawing import drawing
from gap_cli.render.mermaid import mermaid
from gap_cli.render.timeline import RunTimeline
from gap_runtime.graph.model import Node, Workflow

MEDIA = {".webm": "video/webm", ".mp4": "video/mp4"}


def page(
    workflow: Workflow,
    sources: Mapping[str, str],
    timeline: RunTimeline | None = None,
    *,
    title: str = "",
    video: Path | None = None,
    video_start: float = 0.0,
) -> str:
    """The page, which needs no network.

    `sources` holds scripts by path. `video` is a WebM or MP4 in world time, whose first frame is at `video_start` [s].
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    env = Environment(loader=PackageLoader("gap_cli.render", "templates"), undefined=StrictUndefined, autoescape=True)
    data = {
        "nodes": _nodes(workflow),
        "subgraphs": _subgraphs(workflow),
        "sources": dict(sources),
        "timeline": None if timeline is None else asdict(timeline),
        "videoStart": video_start,
        "mermaid": mermaid(workflow),
    }
    return env.get_template("view.html.j2").render(
        title=title or workflow.meta.get("name", "") or "workflow",
        description=workflow.meta.get("description", ""),
        svg=drawing(workflow),
        data=embedded(data),
        timeline=timeline,
        video="" if video is None else _data_uri(video),
    )


def embedded(data: Any) -> str:
    """JSON that is safe inside a <script> element."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _nodes(workflow: Workflow) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for top, node in workflow.nodes.items():
        if node.type == "end":
            found[top] = {
                "kind": f"end, {node.status}",
                "inputs": {},
                "recovery": [c.model_dump() for c in node.recovery],
            }
        definition = workflow.subgraphs.get(node.ref or "")
        for name, inner in definition.nodes.items() if definition else ():
            found[f"{top}/{name}"] = _node(inner)
    return found


def _node(node: Node) -> dict[str, Any]:
    return {
        "kind": node.type + (", streaming" if node.streaming else ""),
        "calls": node.tool or node.script or "",
        "script": node.script or "",
        "inputs": node.inputs,
        "deadline_s": node.deadline_s,
        "description": node.description,
    }


def _subgraphs(workflow: Workflow) -> dict[str, Any]:
    found = {}
    for top, node in workflow.nodes.items():
        definition = workflow.subgraphs.get(node.ref or "")
        if definition is not None:
            found[top] = {
                "skill": definition.skill, "description": definition.description, "inputs": definition.inputs,
                "outputs": definition.outputs, "parameters": definition.parameters, "on_error": definition.on_error,
                "exits": definition.exit.success_values,
            }  # fmt: skip
    return found


def _data_uri(file: Path) -> str:
    return f"data:{MEDIA.get(file.suffix, 'video/webm')};base64,{base64.b64encode(file.read_bytes()).decode('ascii')}"
