"""What leads where at the top level, as people read it: every link with the exits that take it."""

from __future__ import annotations

from itertools import permutations

from gap_cli.analysis.exit_flow import ExitFlowGraph
from gap_runtime.graph.model import Workflow

Link = tuple[str, str]


def top_links(workflow: Workflow) -> dict[Link, list[str]]:
    """Every link with its exits, plain edges first; a plain edge from a subgraph is for any success."""
    found: dict[Link, list[str]] = {}
    for a, b in workflow.edges:
        node = workflow.nodes.get(a)
        definition = workflow.subgraphs.get(node.ref or "") if node is not None else None
        found.setdefault((a, b), []).extend(definition.exit.success_values if definition is not None else ())
    for a, routing in workflow.conditional_edges.items():
        for value, b in routing.mapping.items():
            exits = found.setdefault((a, b), [])
            exits += [value] if value not in exits else []
    return found


def side_by_side(workflow: Workflow) -> dict[str, list[str]]:
    """For each subgraph node those that may run at the same time, where there are any."""
    exit_flow = ExitFlowGraph(workflow)
    nodes = [n for n, node in workflow.nodes.items() if node.type == "subgraph"] if exit_flow.forks else []
    found: dict[str, list[str]] = {}
    for one, other in permutations(nodes, 2):
        if exit_flow.parallel.may_overlap(one, other):
            found.setdefault(one, []).append(other)
    return found
