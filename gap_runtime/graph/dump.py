"""Writes a workflow as plain data in one fixed order, so that two equal graphs are the same bytes."""

from __future__ import annotations

from typing import Any

from gap_runtime.graph.model import Node, Routing, SubgraphDef, Workflow


def dump_workflow(workflow: Workflow) -> dict[str, Any]:
    """Plain data: keys in the model's order, what equals its default left out, names in the order they were written."""
    return {
        "version": workflow.version,
        **_given(meta=dict(workflow.meta)),
        "nodes": {name: _node(n) for name, n in workflow.nodes.items()},
        **_given(edges=[list(e) for e in workflow.edges], conditional_edges=_routes(workflow.conditional_edges)),
        "subgraphs": {name: dump_subgraph(d) for name, d in workflow.subgraphs.items()},
    }


def dump_subgraph(definition: SubgraphDef) -> dict[str, Any]:
    """One subgraph definition, likewise."""
    return {
        "skill": definition.skill,
        **_given(
            description=definition.description,
            stage=definition.stage,
            inputs=dict(definition.inputs),
            outputs=dict(definition.outputs),
        ),
        "nodes": {name: _node(n) for name, n in definition.nodes.items()},
        "edges": [list(e) for e in definition.edges],
        **_given(conditional_edges=_routes(definition.conditional_edges)),
        "exit": {
            "router_field": definition.exit.router_field,
            "success_values": list(definition.exit.success_values),
        },
        **_given(on_error=definition.on_error, names=dict(definition.names), parameters=dict(definition.parameters)),
    }


def _node(node: Node) -> dict[str, Any]:
    return {
        "type": node.type,
        **_given(
            tool=node.tool,
            script=node.script,
            ref=node.ref,
            inputs=dict(node.inputs),
            streaming=node.streaming or None,
            deadline_s=node.deadline_s,
            status=node.status,
            recovery=[{"tool": c.tool, **_given(inputs=dict(c.inputs))} for c in node.recovery],
            max_visits=node.max_visits,
            description=node.description,
        ),
    }


def _routes(routes: dict[str, Routing]) -> dict[str, Any]:
    return {source: {"router_field": r.router_field, "mapping": dict(r.mapping)} for source, r in routes.items()}


def _given(**keys: Any) -> dict[str, Any]:
    return {k: v for k, v in keys.items() if v is not None and v not in ("", [], {})}
