"""The shape of a graph as bit masks: who waits for whom, and which nodes can run again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.graph.compiled import Routes
from gap_runtime.graph.concurrency import bits
from gap_runtime.graph.control_flow import Flow
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
    reached = [
        out[i] | {t for ts in routes[i].targets.values() for t in ts} if i in routes else out[i] for i in index.values()
    ]
    return Topology(
        ordered, index, entries, tuple(tuple(sorted(o)) for o in out), frozenset(ends), routes,
        _waits_for(Flow(ordered, edges, routing), index), _looped(reached),
    )  # fmt: skip


def _routes(routing: Routing, entries: tuple[int, ...], find: Callable[[str], int]) -> Routes:
    targets: dict[str, tuple[int, ...]] = {}
    for value, name in routing.mapping.items():
        targets[value] = () if name == END else entries if name == START else (find(name),)
    ends = frozenset(value for value, name in routing.mapping.items() if name == END)
    fields = tuple(routing.router_field.split(".")) if routing.router_field else ()
    return Routes(fields, targets, ends)


def _waits_for(flow: Flow, index: Mapping[str, int]) -> tuple[int, ...]:
    """Without the edges back: joins of one loop can reach each other through the next pass, and do not wait for it.
    What comes after a loop waits for all of it."""
    into: list[set[int]] = [set() for _ in index]
    entries: set[int] = set()
    for number, arc in enumerate(flow.arcs):
        source, target = flow.names[arc.source], flow.names[arc.target]
        if source == START and target in index:
            entries.add(index[target])
        elif number not in flow.back and target in index:
            into[index[target]].add(index[source])
    loops = [
        (1 << index[flow.names[head]] if head else -1, _renumbered(flow, body, index))
        for head, body in (flow.loops.items() if flow.back else ())
    ]
    return tuple(_ancestors(i, into, loops) if len(into[i]) + (i in entries) > 1 else 0 for i in range(len(index)))


def _renumbered(flow: Flow, mask: int, index: Mapping[str, int]) -> int:
    return sum(1 << index[flow.names[i]] for i in bits(mask) if flow.names[i] in index)


def _ancestors(node: int, into: Sequence[set[int]], loops: Sequence[tuple[int, int]]) -> int:
    seen: set[int] = set()
    todo = [node]
    while todo:
        fresh = into[todo.pop()] - seen
        seen |= fresh
        todo.extend(fresh)
    mask = sum(1 << i for i in seen)
    for head, body in loops:
        if mask & head and not body >> node & 1:
            mask |= body
    return mask & ~(1 << node)


def _looped(reached: Sequence[set[int]]) -> frozenset[int]:
    """Nodes on a cycle or between two: what is left once dead ends and dead starts are peeled off."""
    left = set(range(len(reached)))
    for edges in (reached, _reversed(reached)):
        degree = [len(edges[i] & left) for i in range(len(reached))]
        back = _reversed(edges)
        todo = [i for i in left if degree[i] == 0]
        while todo:
            gone = todo.pop()
            left.discard(gone)
            for i in back[gone] & left:
                degree[i] -= 1
                if degree[i] == 0:
                    todo.append(i)
    return frozenset(left)


def _reversed(edges: Sequence[set[int]]) -> list[set[int]]:
    back: list[set[int]] = [set() for _ in edges]
    for source, targets in enumerate(edges):
        for target in targets:
            back[target].add(source)
    return back
