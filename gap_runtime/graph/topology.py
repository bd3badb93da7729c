"""The shape of a graph as bit masks: who waits for whom, and which nodes can run again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_

from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.graph.compiled import Routes
from gap_runtime.graph.control_flow import FIRST, ControlFlowGraph
from gap_runtime.graph.model import END, START, Edge, Routing


@dataclass(frozen=True)
class Topology:
    """Edges by index of the sorted node names. `waits_for[i]`: a mask of all nodes from which a join node i can be
    reached within one pass, 0 for a node with one way in (it cannot be waiting for anyone once it was reached)."""

    names: tuple[str, ...]
    index: Mapping[str, int]
    entries: tuple[int, ...]
    successors: tuple[tuple[int, ...], ...]
    ends: frozenset[int]
    routes: Mapping[int, Routes]
    waits_for: tuple[int, ...]
    looped: frozenset[int]


def make_topology(names: Sequence[str], edges: Sequence[Edge], routing: Mapping[str, Routing], where: str) -> Topology:
    """Resolve edges to indices. Raises `UnknownNameError` for an edge to nowhere."""
    ordered = tuple(sorted(names))
    index = {name: i for i, name in enumerate(ordered)}

    def find(name: str) -> int:
        if name not in index:
            raise UnknownNameError(f"node (edges of {where})", name, index)
        return index[name]

    entries = tuple(sorted({find(b) for a, b in edges if a == START}))
    out: list[set[int]] = [set() for _ in ordered]
    ends: set[int] = set()
    for source, target in edges:
        if source == START:
            continue
        if target == END:
            ends.add(find(source))
        else:
            out[find(source)].update(entries if target == START else (find(target),))
    routes = {find(source): _routes(r, entries, find) for source, r in routing.items()}
    flow = ControlFlowGraph(ordered, edges, routing)
    looped = reduce(or_, flow.bodies.values(), 0)
    return Topology(
        ordered, index, entries, tuple(tuple(sorted(o)) for o in out), frozenset(ends), routes,
        tuple(_waits_for(flow, flow.index[name]) for name in ordered),
        frozenset(i for name, i in index.items() if looped >> flow.index[name] & 1),
    )  # fmt: skip


def _routes(routing: Routing, entries: tuple[int, ...], find: Callable[[str], int]) -> Routes:
    targets: dict[str, tuple[int, ...]] = {}
    for value, name in routing.mapping.items():
        targets[value] = () if name == END else entries if name == START else (find(name),)
    ends = frozenset(value for value, name in routing.mapping.items() if name == END)
    fields = tuple(routing.router_field.split(".")) if routing.router_field else ()
    return Routes(fields, targets, ends)


def _waits_for(flow: ControlFlowGraph, node: int) -> int:
    """Without the edges back: joins of one loop can reach each other through the next pass, and do not wait for it.
    What comes after a loop waits for all of it."""
    ways_in = {flow.arcs[number].source for number in flow.into[node] if number not in flow.back}
    return flow.before.get(node, 0) >> FIRST if len(ways_in) > 1 else 0
