"""W2, W3, W5, W6: the keys each type of node has, what meta says, names, and size."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.load import RETIRED, migration
from gap_runtime.graph.model import Node, SubgraphDef, Workflow

MAX_NODES, MAX_ARCS, MAX_TOTAL, MAX_NAMES = 500, 2000, 10_000, 100
_FEWER = f"At most {MAX_NAMES} are allowed."
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
_RESERVED = {"START", "END", "in", "param"}
_COMMON = {"type", "description", "max_visits"}
_CALL = _COMMON | {"inputs", "deadline_s"}
KEYS: dict[str, tuple[set[str], set[str]]] = {  # type -> (keys it needs, keys it may have)
    "tool": ({"tool"}, _CALL | {"tool", "streaming"}),
    "script": ({"script"}, _CALL | {"script", "streaming"}),
    "router": ({"script"}, _CALL | {"script"}),
    "noop": (set(), _COMMON),
    "subgraph": ({"ref"}, _COMMON | {"ref"}),
    "end": ({"status"}, {"type", "description", "status", "recovery"}),
}
INSIDE, TOP = ("tool", "script", "router", "noop"), ("subgraph", "end")


def w2_keys_of_a_node(sg: SubgraphContext) -> Iterator[Finding]:
    """W2 inside a subgraph."""
    yield from _keys(sg.nodes, INSIDE, f"{sg.path}.")


def w2_keys_at_the_top(context: WorkflowContext) -> Iterator[Finding]:
    """W2 at the top level."""
    yield from _keys(context.workflow.nodes, TOP, "")


def _keys(nodes: Mapping[str, Node], here: tuple[str, ...], prefix: str) -> Iterator[Finding]:
    for name, node in nodes.items():
        path = f"{prefix}nodes.{name}"
        if node.type not in here:
            yield Finding(f"{path}.type", "W2", *_wrong_type(node, here))
            continue
        needed, allowed = KEYS[node.type]
        given = {k for k in node.model_fields_set if getattr(node, k) not in (None, False, "", {}, [])}
        for key in sorted(needed - given):
            yield Finding(path, "W2", f"a node of type {node.type} needs {key!r}")
        for key in sorted(given - allowed):
            yield Finding(f"{path}.{key}", "W2", f"a node of type {node.type} has no {key!r}", "Drop it.")


def _wrong_type(node: Node, here: tuple[str, ...]) -> tuple[str, str]:
    if node.type in RETIRED:
        return f"node type {node.type!r} is retired", migration(node.type, node.model_dump())
    if node.type in KEYS:
        place = "only stands at the top level" if here is INSIDE else "only stands inside a subgraph"
        return f"a node of type {node.type} {place}", f"Here: {', '.join(here)}."
    return f"there is no node type {node.type!r}", did_you_mean(node.type, here)


def w3_meta(context: WorkflowContext) -> Iterator[Finding]:
    """W3: the meta keys that mean something; the version is the reader's to check."""
    workflow = context.workflow
    hz = workflow.meta.get("observation_stream_hz")
    if hz is not None and not _positive(hz):
        yield Finding("meta.observation_stream_hz", "W3", f"{hz!r} is not a positive number", 'Write "10".')
    enforce = workflow.meta.get("validate_checkpoints")
    if enforce not in (None, "true", "false"):
        yield Finding("meta.validate_checkpoints", "W3", f"{enforce!r} is neither true nor false", 'Write "true".')


def _positive(text: str) -> bool:
    try:
        return 0 < float(text) < float("inf")
    except ValueError:
        return False


def w5_names(context: WorkflowContext) -> Iterator[Finding]:
    """W5: names that a reference, a file or a reader could not carry."""
    workflow = context.workflow
    yield from _names("nodes", workflow.nodes)
    yield from _names("subgraphs", workflow.subgraphs)
    for sg in context.subgraphs.values():
        d = sg.definition
        for part, names in (("nodes", d.nodes), ("inputs", d.inputs), ("outputs", d.outputs)):
            yield from _names(f"{sg.path}.{part}", names)
        values = {"exit.success_values": d.exit.success_values, "on_error": [d.on_error] if d.on_error else []}
        for part, words in values.items():
            yield from _names(f"{sg.path}.{part}", dict.fromkeys(words), whole_path=True)


def _names(path: str, names: Mapping[str, object], *, whole_path: bool = False) -> Iterator[Finding]:
    for name in names:
        if not _NAME.fullmatch(name) or name in _RESERVED:
            where = path if whole_path else f"{path}.{name[:80]}"
            message = (
                f"{name[:80]!r} cannot be a name" if name not in _RESERVED else f"{name!r} is taken by the language"
            )
            yield Finding(where, "W5", message, "Names are up to 64 letters, digits and _, not starting with a digit.")


def w6_size(workflow: Workflow) -> list[Finding]:
    """W6: more than anyone could review. Nothing else is looked at then."""
    graphs: dict[str, Workflow | SubgraphDef] = {"nodes": workflow}
    graphs |= {f"subgraphs.{n}.nodes": d for n, d in workflow.subgraphs.items()}
    found, total = [], 0
    for path, graph in graphs.items():
        arcs = len(graph.edges) + sum(len(r.mapping) for r in graph.conditional_edges.values())
        total += len(graph.nodes) + arcs
        if len(graph.nodes) > MAX_NODES or arcs > MAX_ARCS:
            message = f"{len(graph.nodes)} nodes and {arcs} edges; a graph may have {MAX_NODES} and {MAX_ARCS}"
            found.append(Finding(path, "W6", message, "Split the task into more subgraphs."))
        found += [
            Finding(f"{path}.{name}", "W6", f"{len(node.inputs) + len(node.recovery)} inputs or calls", _FEWER)
            for name, node in graph.nodes.items()
            if len(node.inputs) + len(node.recovery) > MAX_NAMES
        ]
    for name, d in workflow.subgraphs.items():
        count = max(map(len, (d.inputs, d.outputs, d.names, d.parameters, d.exit.success_values)))
        if count > MAX_NAMES:
            found.append(Finding(f"subgraphs.{name}", "W6", f"{count} inputs, outputs or exits", _FEWER))
    if not found and total > MAX_TOTAL:
        found.append(Finding("subgraphs", "W6", f"{total} nodes and edges in all; a workflow may have {MAX_TOTAL}"))
    return found


RULES = (w2_keys_of_a_node,)
TOP_RULES = (w2_keys_at_the_top, w3_meta, w5_names)
