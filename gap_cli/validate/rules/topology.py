"""W7-W10, W14 and W15: where the task begins, where each exit leads, where it ends, and how often it may go round."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_cli.validate.rules.structure import dangling
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.model import END, START

EXIT = "exit"


def s1_top(context: WorkflowContext) -> Iterator[Finding]:
    """S1 at the top level."""
    w = context.workflow
    yield from dangling(set(w.nodes), w.edges, w.conditional_edges)


def w7_entry(context: WorkflowContext) -> Iterator[Finding]:
    """W7: the task begins with a subgraph, or with several side by side."""
    w = context.workflow
    entries = [(i, target) for i, (source, target) in enumerate(w.edges) if source == START]
    if START in w.conditional_edges:
        yield Finding("conditional_edges.START", "W7", "START decides nothing", "Use spec.add_edge(START, ...).")
    if not entries:
        yield Finding("edges", "W7", "nothing starts the task", "Add spec.add_edge(START, <first subgraph node>).")
    for i, target in entries:
        if target == END or (target in w.nodes and w.nodes[target].type != "subgraph"):
            yield Finding(f"edges.{i}", "W7", f"the task starts at {target!r}, which is not a subgraph")


def w8_every_exit_is_routed(context: WorkflowContext) -> Iterator[Finding]:
    """W8: every success value and on_error leads somewhere, and nothing else does; a plain edge is for any success."""
    w = context.workflow
    for i, (source, target) in enumerate(w.edges):
        if target == END and source != START:
            yield Finding(f"edges.{i}", "W8", "leads to END", "Lead to an end node (spec.add_end).")
    for source, routes in w.conditional_edges.items():
        path = f"conditional_edges.{source}"
        if source in w.nodes and w.nodes[source].type == "subgraph" and routes.router_field != EXIT:
            yield Finding(path, "W8", f"router_field is {routes.router_field!r}", 'At the top level it is "exit".')
        for value, target in routes.mapping.items():
            if target == END:
                yield Finding(f"{path}.mapping.{value}", "W8", "leads to END", "Lead to an end node (spec.add_end).")
    for name, sg in context.subgraph_nodes():
        yield from _routed(context, name, sg)


def _routed(context: WorkflowContext, name: str, sg: SubgraphContext) -> Iterator[Finding]:
    success, on_error = sg.definition.exit.success_values, sg.on_error
    exits = list(dict.fromkeys([*success, on_error] if on_error else success))
    routes = context.workflow.conditional_edges.get(name)
    mapping = routes.mapping if routes is not None else {}
    plain = any(source == name for source, _ in context.workflow.edges)
    missing = [v for v in exits if v not in mapping and not (plain and v != on_error)]
    unknown = [v for v in mapping if v not in exits]
    renamed = len(missing) == len(unknown) == 1 and not (sg.contract and unknown[0] == sg.contract.exits.failure)
    for value in missing:
        kind = "on_error" if value == on_error else "exit"
        hint = f'Add "{value}": <node> to the conditional edges of {name}.'
        hint = f'Write "{value}" for "{unknown[0]}" in the conditional edges of {name}.' if renamed else hint
        yield Finding(f"conditional_edges.{name}", "W8", f"{kind} {value!r} of {name!r} leads nowhere", hint)
    for value in unknown:
        hint = f'Declare on_error="{value}", or route "{on_error}".' if on_error in missing else ""
        hint = f'Write "{missing[0]}" for it.' if renamed else hint or did_you_mean(value, exits)
        yield Finding(f"conditional_edges.{name}.mapping.{value}", "W8", f"{value!r} is not an exit of {name!r}", hint)


def w15_failures_do_not_end_well(context: WorkflowContext) -> Iterator[Finding]:
    """W15, a note: on_error leads to a success end, so that whatever breaks in there counts as success."""
    w = context.workflow
    for name, sg in context.subgraph_nodes():
        routes = w.conditional_edges.get(name)
        end = routes.mapping.get(sg.on_error) if routes is not None else None
        if end in w.nodes and w.nodes[end].status == "success":
            message = f"{sg.on_error!r} leads to the success end {end!r}: a crash in {name!r} would count as success"
            hint = "Lead it to a failure end, or to a subgraph that does without."
            yield Finding(f"conditional_edges.{name}.mapping.{sg.on_error}", "W15", message, hint, "note")


def w9_ends(context: WorkflowContext) -> Iterator[Finding]:
    """W9: a success end that can be reached, no end or subgraph out of reach, and nothing after an end."""
    w, flow = context.workflow, context.flow
    ends = [n for n, node in w.nodes.items() if node.type == "end"]
    if not any(w.nodes[n].status == "success" for n in ends):
        yield Finding("nodes", "W9", "no end is a success", 'Add spec.add_end("done", status="success").')
    for name, node in w.nodes.items():
        if node.type in ("end", "subgraph") and flow.index[name] not in flow.rank:
            yield Finding(f"nodes.{name}", "W9", "cannot be reached from START", "Lead an exit to it, or drop it.")
    for i, (source, _) in enumerate(w.edges):
        if source in ends:
            yield Finding(f"edges.{i}", "W9", f"an edge leaves the end {source!r}", "Drop it.")
    for source in w.conditional_edges:
        if source in ends:
            yield Finding(f"conditional_edges.{source}", "W9", f"edges leave the end {source!r}", "Drop them.")


def w10_definitions(context: WorkflowContext) -> Iterator[Finding]:
    """W10: every reference has its definition and every definition its node."""
    w = context.workflow
    used = set()
    for name, node in w.nodes.items():
        if node.type == "subgraph" and node.ref is not None:
            used.add(node.ref)
            if node.ref not in w.subgraphs:
                hint = did_you_mean(node.ref, w.subgraphs)
                yield Finding(f"nodes.{name}.ref", "W10", f"there is no subgraph {node.ref!r}", hint)
    for name in w.subgraphs:
        if name not in used:
            hint = f'InputSlot it: spec.add_subgraph_node("{name}", ref="{name}"); or drop it.'
            yield Finding(f"subgraphs.{name}", "W10", "no node refers to it", hint)


def w14_loops_have_a_budget(context: WorkflowContext) -> Iterator[Finding]:
    """W14: a loop of subgraphs none of which says how often it may be visited."""
    if not context.flow.back:
        return
    import networkx as nx  # takes 80 ms, and only a graph with loops needs it

    w = context.workflow
    routed = [(s, t) for s, routes in w.conditional_edges.items() for t in routes.mapping.values()]
    graph = nx.DiGraph([*w.edges, *routed])
    graph.remove_nodes_from([n for n, node in w.nodes.items() if node.max_visits is not None])
    for loop in nx.strongly_connected_components(graph):
        first = min(loop)
        if len(loop) > 1 or graph.has_edge(first, first):
            hint = f'Write spec.add_subgraph_node("{first}", ..., max_visits=<n>).'
            yield Finding(f"nodes.{first}", "W14", f"{', '.join(sorted(loop))} can go round without end", hint)


TOP_RULES = (
    s1_top,
    w7_entry,
    w8_every_exit_is_routed,
    w9_ends,
    w10_definitions,
    w14_loops_have_a_budget,
    w15_failures_do_not_end_well,
)
