"""Everything about a run that episodes share and no world is needed for: its graph, goals, checkpoints, judge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, Field

from gap_cli.rehearse.judge import Conditions, make_conditions
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import digest, product
from gap_runtime.contracts.documents import read_json, read_text
from gap_runtime.contracts.models import Document
from gap_runtime.errors import RunError
from gap_runtime.graph.checkpoints import Checkpoint, parse_checkpoints
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.compiled import CompiledGraph
from gap_runtime.graph.load import load_workflow
from gap_runtime.graph.model import START, Workflow


class PlanPart(Document):
    """What rolling out and judging needs of plan.json; the author owns the rest of it."""

    model_config = ConfigDict(extra="ignore", frozen=True)
    scene: str
    goals: list[dict[str, str]] = Field(min_length=1)


class FindingPart(Document):
    """What the gate before a rehearsal needs of a finding."""

    model_config = ConfigDict(extra="ignore", frozen=True)
    code: str
    path: str
    message: str
    severity: str = "error"


class Validated(Document):
    """What the gate before a rehearsal needs of findings.json: the digest of the graph it judged, and the verdict."""

    model_config = ConfigDict(extra="ignore", frozen=True)
    workflow: str
    findings: list[FindingPart]


@dataclass(frozen=True)
class Prepared:
    """A graph ready to be run and judged. `checkpoints` are by subgraph definition."""

    inventory: Inventory
    file: Path
    graph: CompiledGraph
    scene: str
    goals: tuple[Mapping[str, str], ...]
    conditions: Conditions
    checkpoints: Mapping[str, tuple[Checkpoint, ...]]


def prepare(run: Run, workflow: Path | None = None) -> Prepared:
    """Compile the run's graph (or another `workflow` of the same plan). Raises `RunError`, `DocumentError`, ..."""
    file = workflow or product(run, "generate")
    where = product(run, "plan")
    plan = PlanPart.load(read_json(where), str(where))
    inventory = Inventory.of(run.asked)
    model = load_workflow(file)
    tools, library = inventory.registry.tools, inventory.library
    canonical = library.canonical_scripts(model, file.parent)
    graph = compile_workflow(model, file.parent, tools, library.contracts, canonical)
    objects = inventory.task.objects
    goals = tuple({role: name for role, name in goal.items() if name in objects} for goal in plan.goals)
    return Prepared(
        inventory, file, graph, plan.scene, goals, make_conditions(inventory.task, goals),
        {name: _checkpoints(file.parent / "checkpoints" / f"{name}.py") for name in model.subgraphs},
    )  # fmt: skip


def require_valid(run: Run) -> Path:
    """The run's workflow, which `gap validate` accepted as it is now. Raises `RunError` with what to type."""
    file = product(run, "generate")
    where = product(run, "validate")
    found = Validated.load(read_json(where), str(where))
    again = f"Type: gap validate {run.name}"
    if found.workflow != digest(file):
        raise RunError(f"The graph of {run.name} has changed since it was validated.", hint=again)
    errors = [f for f in found.findings if f.severity == "error"]
    if errors:
        first = errors[0]
        raise RunError(
            f"The graph of {run.name} has {len(errors)} errors: {first.code} {first.path}: {first.message}",
            hint=f"Mend it. {again}",
        )
    return file


def describe(prepared: Prepared, lock: Path) -> dict[str, Any]:
    """What was rolled out, for the summary: question, graph, who served its tools, and its subgraphs in order."""
    asked, library, graph = prepared.inventory.asked, prepared.inventory.library, prepared.graph
    tools = prepared.inventory.registry.tools
    used = tools_used(graph)
    subgraphs = []
    for name in in_order(graph.workflow):
        ref = graph.workflow.nodes[name].ref or ""
        definition = graph.workflow.subgraphs[ref]
        contract = library.find(definition.skill).contract
        subgraphs.append({
            "node": name, "ref": ref, "skill": definition.skill.replace("_", "-"),
            "stage": definition.stage or contract.stage or "", "swaps": contract.swaps,
            "parameters": list(contract.parameters),
        })  # fmt: skip
    return {
        "task": asked.task, "variant": asked.variant, "instruction": asked.instruction, "scene": prepared.scene,
        "goals": [dict(goal) for goal in prepared.goals], "workflow": digest(prepared.file), "lock": digest(lock),
        "providers": {name: f"{tools[name].provider} ({tools[name].plugin})" for name in used},
        "privileged_tools": [name for name in used if tools[name].spec.privileged],
        "jailed_nodes": sorted(graph.jailed),
        "subgraphs": subgraphs,
    }  # fmt: skip


def in_order(workflow: Workflow) -> list[str]:
    """The subgraph nodes as control first reaches them, breadth first; then any it never does."""
    after: dict[str, list[str]] = {}
    for a, b in workflow.edges:
        after.setdefault(a, []).append(b)
    for a, routing in workflow.conditional_edges.items():
        after.setdefault(a, []).extend(routing.mapping.values())
    found = dict.fromkeys([START])
    for name in (queue := [START]):
        fresh = [n for n in after.get(name, ()) if n not in found]
        found |= dict.fromkeys(fresh)
        queue += fresh
    return [n for n in [*found, *(m for m in workflow.nodes if m not in found)]
            if n in workflow.nodes and workflow.nodes[n].type == "subgraph"]  # fmt: skip


def tools_used(graph: CompiledGraph) -> list[str]:
    """Every tool a node of the graph may call, sorted."""
    found: set[str] = set()
    for node in graph.inner_nodes():
        if node.callee is not None:
            found |= {node.callee.name} if node.callee.name in graph.callees else set()
            found |= node.callee.allowed
    return sorted(name for name in found if name in graph.callees and graph.callees[name].kind == "tool")


def _checkpoints(file: Path) -> tuple[Checkpoint, ...]:
    return parse_checkpoints(read_text(file), str(file)) if file.is_file() else ()
