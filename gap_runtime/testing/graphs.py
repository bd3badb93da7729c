"""Little workflows of fake tools, compiled and run in a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gap_runtime.contracts.skill import Exits, SkillContract
from gap_runtime.contracts.tool import Tool
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.compiled import CompiledGraph
from gap_runtime.graph.model import Workflow
from gap_runtime.run.events import Observer
from gap_runtime.run.execute import RunResult, RunSetup, run_graph
from gap_runtime.testing.tools import FAKE_TOOLS


def fake_tools(*more: Tool) -> dict[str, Tool]:
    """The fake tools by name, with `more` of your own."""
    return {t.spec.name: t for t in (*FAKE_TOOLS, *more)}


def fake_skill(more: Sequence[str] = (), **changes: Any) -> SkillContract:
    """A composite skill that may call every fake tool and `more`."""
    names = [*(t.spec.name for t in FAKE_TOOLS), *more]
    contract: dict[str, Any] = {
        "kind": "composite",
        "template": "t.j2",
        "tools": names,
        "exits": Exits(success={"done": "done"}, failure="failed"),
    }
    return SkillContract(**{**contract, **changes})


def compile_fake(
    workflow: Workflow, *more: Tool, folder: Path = Path(), canonical: Mapping[str, Path] | None = None, **skill: Any
) -> CompiledGraph:
    """Compile a workflow whose subgraphs are of skill `fake`, with the fake tools and `more`."""
    contract = fake_skill([t.spec.name for t in more], **skill)
    return compile_workflow(workflow, folder, fake_tools(*more), {"fake": contract}, canonical or {})


def run_fake(workflow: Workflow, *more: Tool, observers: Sequence[Observer] = (), **setup: Any) -> RunResult:
    """Compile and run such a workflow; `setup` goes to `RunSetup`."""
    return run_graph(compile_fake(workflow, *more), RunSetup(**setup), observers)


def fake_workflow(
    nodes: Mapping[str, Any], edges: Sequence[tuple[str, str]], *, recovery: Sequence[Any] = (), **definition: Any
) -> Workflow:
    """One subgraph `main` of skill `fake` between START and the ends `success` and `abort`.

    A node may be given as a tool's name. `done` is the success exit, `failed` the failure exit.
    """
    full = {name: {"type": "tool", "tool": n} if isinstance(n, str) else n for name, n in nodes.items()}
    subgraph = {
        "skill": "fake",
        "nodes": {**full, "done": {"type": "noop"}},
        "edges": [*edges, ("done", "END")],
        "exit": {"success_values": ["done"]},
        "on_error": "failed",
        **definition,
    }
    top = {
        "main": {"type": "subgraph", "ref": "main_sg"},
        "success": {"type": "end", "status": "success"},
        "abort": {"type": "end", "status": "failure", "recovery": list(recovery)},
    }
    routing = {"main": {"router_field": "exit", "mapping": {"done": "success", "failed": "abort"}}}
    data = {
        "nodes": top,
        "edges": [("START", "main")],
        "conditional_edges": routing,
        "subgraphs": {"main_sg": subgraph},
    }
    return Workflow.load(data, "fake workflow")
