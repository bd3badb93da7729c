"""Everything about a bundle that episodes share and no world is needed for: its compiled graph and its judge."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gap_cli.rehearse.judge import Conditions, make_conditions
from gap_cli.workspace.inventory import Inventory
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.compiled import CompiledGraph
from gap_runtime.graph.model import START, Workflow


@dataclass(frozen=True)
class Prepared:
    """A bundle ready to be run and judged. `goals` map a role to an object of the task."""

    inventory: Inventory
    bundle: GraphBundle
    graph: CompiledGraph
    goals: tuple[Mapping[str, str], ...]
    conditions: Conditions


def compile_bundle(bundle: GraphBundle, folder: Path, inventory: Inventory) -> CompiledGraph:
    """The bundle's graph, with the scripts in `folder`; those that are an installed skill's own run in process.

    Raises `UnknownNameError`, `DocumentError`.
    """
    tools, library = inventory.registry.tools, inventory.library
    canonical = library.canonical_scripts(bundle.workflow, folder)
    return compile_workflow(bundle.workflow, folder, tools, library.contracts, canonical)


def prepare(bundle: GraphBundle, folder: Path, inventory: Inventory) -> Prepared:
    """Compile the bundle stored in `folder` and read its goals and checkpoints. Raises `RunError`, `DocumentError`."""
    graph = compile_bundle(bundle, folder, inventory)
    objects = inventory.task.objects
    facts = bundle.goals.predicates()
    goals = tuple({role: name for role, name in fact.roles.items() if name in objects} for fact in facts)
    _ = bundle.checkpoints  # refused now where one cannot be read, not when the first subgraph ends
    return Prepared(inventory, bundle, graph, goals, make_conditions(inventory.task, goals))


def describe(prepared: Prepared, lock: str) -> dict[str, Any]:
    """What was rolled out, for the summary: question, bundle, who served its tools, and its subgraphs in order. `lock`
    is the digest of the lock that the results depend on."""
    inventory, graph = prepared.inventory, prepared.graph
    config, library, tools = inventory.config, inventory.library, inventory.registry.tools
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
        "task": config.task, "variant": config.variant, "instruction": config.instruction,
        "scene": prepared.bundle.goals.scene, "goals": [dict(goal) for goal in prepared.goals],
        "bundle": inventory.digest(prepared.bundle).sha256, "lock": lock,
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
