"""How control can flow through one graph: the order of its nodes, its loops, and what can lead to what.

The semantics are the interpreter's. A node's static edges are all taken; of its conditional edges one is, or from a
fan-out router any number but none. A node that several edges lead to waits for every branch that may still reach it. An
edge back to a node that dominates its source starts a new pass of a loop. Sets of nodes and edges are bit masks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from gap_runtime.graph.model import END, START, Edge, Routing

FIRST = 2  # number of the first node after START and END


@dataclass(frozen=True)
class Arc:
    """One edge, by node numbers. `value` is what a conditional edge is taken for, None for a static one."""

    source: int
    target: int
    value: str | None


class ControlFlowGraph:
    """The flow of one graph. START is node 0 and END node 1; unknown names in edges are left out (rule S1 has them).

    `fan_out` names routers that may start several targets, or one target several times.
    """

    def __init__(
        self,
        names: Iterable[str],
        edges: Sequence[Edge],
        routing: Mapping[str, Routing],
        fan_out: frozenset[str] = frozenset(),
    ) -> None:
        self.names = [START, END, *names]
        self.index = {name: i for i, name in enumerate(self.names)}
        self.fan_out = {self.index[n] for n in fan_out if n in self.index}
        self.arcs: list[Arc] = []
        known = self.index
        for source, target in dict.fromkeys(map(tuple, edges)):
            if source in known and target in known and source != END:
                self.arcs.append(Arc(known[source], known[target], None))
        for source, routes in routing.items():
            for value, target in routes.mapping.items():
                if source in known and target in known:
                    self.arcs.append(Arc(known[source], known[target], value))
        self.out: list[list[int]] = [[] for _ in self.names]
        self.into: list[list[int]] = [[] for _ in self.names]
        for number, arc in enumerate(self.arcs):
            self.out[arc.source].append(number)
            self.into[arc.target].append(number)

    @cached_property
    def order(self) -> list[int]:
        """Nodes reachable from START; without the edges back, each after all it can be reached from.

        Reverse postorder, written out: scipy has none, and the run time does not install networkx.
        """
        arcs, seen, finished = self.arcs, {0}, []
        stack: list[tuple[int, Iterator[int]]] = [(0, iter(self.out[0]))]
        while stack:
            node, rest = stack[-1]
            for number in rest:
                target = arcs[number].target
                if target not in seen:
                    seen.add(target)
                    stack.append((target, iter(self.out[target])))
                    break
            else:
                finished.append(node)
                stack.pop()
        return finished[::-1]

    @cached_property
    def rank(self) -> dict[int, int]:
        """Position in `order`."""
        return {node: i for i, node in enumerate(self.order)}

    @cached_property
    def back(self) -> frozenset[int]:
        """Edges that go against `order`: each either closes a loop or enters one in its middle."""
        rank = self.rank
        return frozenset(n for n, a in enumerate(self.arcs) if a.source in rank and rank[a.target] <= rank[a.source])

    @cached_property
    def bodies(self) -> dict[int, int]:
        """For each edge back, the nodes on the ways from its target to its source, both included."""
        found: dict[int, int] = {}
        for number in self.back:
            head, tail = self.arcs[number].target, self.arcs[number].source
            body, todo = (1 << head) | (1 << tail), [tail] if tail != head else []
            while todo:
                for arc in self.into[todo.pop()]:
                    source = self.arcs[arc].source
                    if source in self.rank and not body >> source & 1:
                        body |= 1 << source
                        todo.append(source)
            found[number] = body
        return found

    @cached_property
    def irreducible(self) -> frozenset[int]:
        """Edges back whose target does not dominate their source, since START lies beyond: loops with two ways in."""
        return frozenset(n for n, body in self.bodies.items() if body & 1 and self.arcs[n].target != 0)

    @cached_property
    def loops(self) -> dict[int, int]:
        """For each head of a loop with one way in, the nodes of its body."""
        found: dict[int, int] = {}
        for number in self.back - self.irreducible:
            head = self.arcs[number].target
            found[head] = found.get(head, 0) | self.bodies[number]
        return found

    @cached_property
    def before(self) -> dict[int, int]:
        """For each node, the nodes that can lead to it within one pass, and all of a loop it comes after: it waits for
        those of them that run."""
        found: dict[int, int] = {}
        for node in self.order:
            mask = 0
            for number in self.into[node]:
                source = self.arcs[number].source
                if number not in self.back and source in found:
                    mask |= found[source] | 1 << source
            for head, body in self.loops.items():
                if mask >> head & 1 and not body >> node & 1:
                    mask |= body
            found[node] = mask
        return found

    def may_precede(self, node: str, other: str) -> bool:
        """True when `other` leads to `node` within one pass."""
        return bool(self.before.get(self.index[node], 0) >> self.index[other] & 1)
