"""S1-S6: what edges may join, and how control may leave a node."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.context import SubgraphContext
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.model import END, START, Edge, Routing

_VIRTUAL = (START, END)


def dangling(names: set[str], edges: list[Edge], routing: dict[str, Routing], prefix: str = "") -> Iterator[Finding]:
    """S1: an edge or a mapping names a node that is not there. Shared by the top level and subgraphs."""
    for i, (source, target) in enumerate(edges):
        for name in (source, target):
            if name not in names and name not in _VIRTUAL:
                yield _unknown(f"{prefix}edges.{i}", name, names)
        if source == END:
            yield Finding(f"{prefix}edges.{i}", "S1", "an edge leaves END", "Nothing comes after END.")
    for source, routes in routing.items():
        path = f"{prefix}conditional_edges.{source}"
        if source not in names:
            yield _unknown(path, source, names)
        for value, target in routes.mapping.items():
            if target not in names and target not in _VIRTUAL:
                yield _unknown(f"{path}.mapping.{value}", target, names)


def _unknown(path: str, name: str, names: set[str]) -> Finding:
    return Finding(path, "S1", f"there is no node {name!r}", did_you_mean(name, names))


def s1_edges_join_declared_nodes(sg: SubgraphContext) -> Iterator[Finding]:
    """S1 inside a subgraph."""
    d = sg.definition
    for finding in dangling(set(d.nodes), d.edges, d.conditional_edges, f"{sg.path}."):
        if not (".mapping." in finding.path and f"{sg.on_error!r}" in finding.message):  # S10 says it better
            yield finding


def s2_everything_is_reachable(sg: SubgraphContext) -> Iterator[Finding]:
    """S2: a node that START does not lead to."""
    if not any(source == START for source, _ in sg.definition.edges):
        yield sg.finding("S2", "edges", "nothing starts this subgraph", "Add an edge from START to its first node.")
        return
    flow = sg.flow
    for name in sg.nodes:
        if flow.index[name] not in flow.rank:
            yield sg.finding("S2", f"nodes.{name}", "cannot be reached from START", _lead_to(sg, name))


def _lead_to(sg: SubgraphContext, name: str) -> str:
    if sg.on_error == name:
        return "on_error is not a node; drop the node."
    return f'Lead to it: add_edge(..., "{name}"); or drop it.'


def s3_everything_leads_on(sg: SubgraphContext) -> Iterator[Finding]:
    """S3: a node that leads nowhere, so that the subgraph would just stop."""
    d = sg.definition
    sources = {source for source, _ in d.edges} | set(d.conditional_edges)
    for name, node in d.nodes.items():
        if name not in sources and not node.streaming:
            hint = f'add_edge("{name}", END)' if node.type == "noop" else f'add_edge("{name}", ...)'
            yield sg.finding("S3", f"nodes.{name}", "leads nowhere", f"Add {hint}.")


def s4_streaming_nodes_are_sources(sg: SubgraphContext) -> Iterator[Finding]:
    """S4: an edge leaves a streaming node, which never finishes."""
    d = sg.definition
    leaving = {source: f"edges.{i}" for i, (source, _) in enumerate(d.edges)}
    leaving |= {source: f"conditional_edges.{source}" for source in d.conditional_edges}
    for name in sorted(sg.streaming & set(leaving)):
        hint = f'It never finishes; read its latest value with Ref("{name}") and drop the edge.'
        yield sg.finding("S4", leaving[name], f"an edge leaves the streaming node {name!r}", hint)


def s5_streaming_is_the_callee_s(sg: SubgraphContext) -> Iterator[Finding]:
    """S5: a node streams what does not stream, or does not stream what does."""
    for name, node in sg.nodes.items():
        callee = sg.callees[name]
        if node.streaming and node.type not in ("tool", "script"):
            yield sg.finding("S5", f"nodes.{name}", f"a {node.type} cannot stream", "Drop streaming=True.")
        elif callee is not None and node.type != "router" and node.streaming != callee.streaming:
            if node.streaming:
                yield sg.finding("S5", f"nodes.{name}", f"{callee.what} does not stream", "Drop streaming=True.")
            else:
                yield sg.finding("S5", f"nodes.{name}", f"{callee.what} streams", "Write streaming=True.")


def s6_routing_fields(sg: SubgraphContext) -> Iterator[Finding]:
    """S6: conditional edges that do not say what decides, or say it of a router, which decides itself."""
    for source, routes in sg.definition.conditional_edges.items():
        path = f"conditional_edges.{source}"
        node = sg.nodes.get(source)
        if node is None:
            continue
        if node.type == "noop":
            yield sg.finding("S6", path, f"{source!r} is a noop and decides nothing", "Route from what it follows.")
        elif source in sg.copied:
            message = f"{source!r} runs in copies, and each would choose"
            yield sg.finding("S6", path, message, f"Collect them: read Ref({sg.copied[source]!r}) in one node.")
        elif node.type != "router" and routes.router_field is None:
            hint = "Name the field of its output: router_field=..."
            yield sg.finding("S6", path, f"nothing says which field of {source!r} decides", hint)
        elif node.type == "router" and routes.router_field is not None:
            yield sg.finding("S6", path, "a router's script returns the target itself", "Drop router_field.")


RULES = (
    s1_edges_join_declared_nodes,
    s2_everything_is_reachable,
    s3_everything_leads_on,
    s4_streaming_nodes_are_sources,
    s5_streaming_is_the_callee_s,
    s6_routing_fields,
)
