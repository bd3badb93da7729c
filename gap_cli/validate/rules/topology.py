"""W7-W10 and W14: where the task begins, where each exit leads, where it ends, and how often it may go round."""

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
    exits = [*dict.fromkeys([*sg.definition.exit.success_values, sg.definition.on_error])]
    routes = context.workflow.conditional_edges.get(name)
    mapping = routes.mapping if routes is not None else {}
    plain = any(source == name for source, _ in context.workflow.edges)
    for value in exits:
        if value not in mapping and not (plain and value != sg.definition.on_error):
            kind = "on_error" if value == sg.definition.on_error else "exit"
            hint = f'Add "{value}": <node> to the conditional edges of {name}.'
            yield Finding(f"conditional_edges.{name}", "W8", f"{kind} {value!r} of {name!r} leads nowhere", hint)
    for value in mapping:
        if value not in exits:
            path = f"conditional_edges.{name}.mapping.{value}"
            on_error = sg.definition.on_error
            hint = f'Declare on_error="{value}", or route "{on_error}".' if on_error not in mapping else ""
            hint = hint or did_you_mean(value, exits)
            yield Finding(path, "W8", f"{value!r} is not an exit of {name!r}", hint)


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
    w = context.workflow
    routed = [(s, t) for s, routes in w.conditional_edges.items() for t in routes.mapping.values()]
    edges = [(s, t) for s, t in [*w.edges, *routed] if s in w.nodes and t in w.nodes]
    free = {n for n, node in w.nodes.items() if node.max_visits is None}
    left = set(free)
    while left:  # peel off what leads out of the free nodes; what stays is on a free loop or leads into one
        leading = {s for s, t in edges if s in left and t in left}
        if leading == left:
            break
        left = leading
    while left:
        reached = {t for s, t in edges if s in left and t in left}
        if reached == left:
            break
        left = reached
    if left:
        first = min(left)
        hint = f'Write spec.add_subgraph_node("{first}", ..., max_visits=<n>).'
        yield Finding(f"nodes.{first}", "W14", f"{', '.join(sorted(left))} can go round without end", hint)


TOP_RULES = (s1_top, w7_entry, w8_every_exit_is_routed, w9_ends, w10_definitions, w14_loops_have_a_budget)
