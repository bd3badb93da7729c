"""How control can flow through one graph: what surely ran before a node, and what may run beside it.

The semantics are the interpreter's. A node's static edges are all taken; of its conditional edges one is, or from a
fan-out router any number but none. A node that several edges lead to waits for every branch that may still reach it. An
edge back to a node that dominates its source starts a new pass of a loop. Sets of nodes and edges are bit masks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from gap_cli.graph.model import END, START, Edge, Routing


@dataclass(frozen=True)
class Arc:
    """One edge, by node numbers. `value` is what a conditional edge is taken for, None for a static one."""

    source: int
    target: int
    value: str | None


class Flow:
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
        """Nodes reachable from START; without the edges back, each after all it can be reached from."""
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
    def endless(self) -> set[int]:
        """Nodes from which control surely goes back to an earlier one, whatever is chosen: a loop nothing leaves."""
        found: set[int] = set()
        for node in reversed(self.order):
            arcs = [(self.arcs[n], n in self.back or self.arcs[n].target in found) for n in self.out[node]]
            choice = [endless for arc, endless in arcs if arc.value is not None]
            if any(endless for arc, endless in arcs if arc.value is None) or (choice and all(choice)):
                found.add(node)
        return found

    @cached_property
    def back(self) -> frozenset[int]:
        """Edges that go against `order`: each either closes a loop or enters one in its middle."""
        rank = self.rank
        return frozenset(n for n, a in enumerate(self.arcs) if a.source in rank and rank[a.target] <= rank[a.source])

    @cached_property
    def loops(self) -> dict[int, int]:
        """For each head of a loop the nodes of its body; edges that do not close a proper loop are not in here."""
        bodies: dict[int, int] = {}
        for number in self.back - self.irreducible:
            head, tail = self.arcs[number].target, self.arcs[number].source
            body, todo = (1 << head) | (1 << tail), [tail] if tail != head else []
            while todo:
                for arc in self.into[todo.pop()]:
                    source = self.arcs[arc].source
                    if source in self.rank and not body >> source & 1:
                        body |= 1 << source
                        todo.append(source)
            bodies[head] = bodies.get(head, 0) | body
        return bodies

    @cached_property
    def irreducible(self) -> frozenset[int]:
        """Back edges whose target does not dominate their source: a loop with two ways in."""
        if not self.back:
            return frozenset()
        return frozenset(n for n in self.back if not self._dominators[self.arcs[n].source] >> self.arcs[n].target & 1)

    @cached_property
    def _dominators(self) -> dict[int, int]:
        everything = (1 << len(self.names)) - 1
        found = dict.fromkeys(self.order, everything)
        found[0] = 1
        changed = True
        while changed:
            changed = False
            for node in self.order[1:]:
                mask = everything
                for number in self.into[node]:
                    source = self.arcs[number].source
                    if source in found:
                        mask &= found[source]
                mask |= 1 << node
                if mask != found[node]:
                    found[node], changed = mask, True
        return found

    @cached_property
    def before(self) -> dict[int, int]:
        """For each node, the nodes that can lead to it within one pass: it waits for those of them that run."""
        found: dict[int, int] = {}
        for node in self.order:
            mask = 0
            for number in self.into[node]:
                source = self.arcs[number].source
                if number not in self.back and source in found:
                    mask |= found[source] | 1 << source
            found[node] = mask
        return found

    @cached_property
    def after(self) -> dict[int, int]:
        """For each node, what surely runs once it has started, if the graph ends well: itself and its consequences."""
        found = dict.fromkeys(self.order, 0)
        exits = {head: self._exits(body) for head, body in self.loops.items()}
        changed = True
        while changed:
            changed = False
            for node in reversed(self.order):
                mask = self._consequences(node, found, exits)
                if mask != found[node]:
                    found[node], changed = mask, bool(self.back)
        return found

    def _consequences(self, node: int, found: Mapping[int, int], exits: Mapping[int, list[int]]) -> int:
        mask, options, any_option = 1 << node, -1, False
        for number in self.out[node]:
            arc = self.arcs[number]
            if number not in self.back:
                reached = found[arc.target]
            else:  # a new pass: what it surely leads to beyond the loop is what every way out of the loop leads to
                ways = [found[t] for t in exits.get(arc.target, ())]
                reached = _intersection(ways) if ways else 0
            if arc.value is None:
                mask |= reached
            else:
                options, any_option = options & reached, True
        return mask | options if any_option else mask

    def _exits(self, body: int) -> list[int]:
        inside = [i for i in range(len(self.names)) if body >> i & 1]
        arcs = (self.arcs[n] for i in inside for n in self.out[i])
        return [a.target for a in arcs if not body >> a.target & 1 and a.target in self.rank]

    @cached_property
    def _sure(self) -> dict[int, int]:
        """For each node, the nodes that surely start in every run in which it does."""
        found: dict[int, int] = {}
        for node in self.order:
            ways = [
                found[self.arcs[n].source]
                for n in self.into[node]
                if n not in self.back and self.arcs[n].source in found
            ]
            found[node] = self.after[node] | (_intersection(ways) if ways else 0)
        return found

    def surely_before(self, node: str, other: str) -> bool:
        """True when `other` has always finished when `node` starts."""
        n, o = self.index[node], self.index[other]
        return n in self.rank and bool((self._sure[n] & self.before[n]) >> o & 1)

    def surely_started(self, node: str, stream: str) -> bool:
        """True when the streaming node `stream`, which nothing waits for, has always been started before `node`."""
        n, s = self.index[node], self.index[stream]
        if n not in self.rank or not self._sure[n] >> s & 1:
            return False
        sources = {self.arcs[a].source for a in self.into[s]}
        return all(source == 0 or self.before[n] >> source & 1 for source in sources)

    def can_precede(self, node: str, other: str) -> bool:
        """True when `other` leads to `node` within one pass."""
        return bool(self.before.get(self.index[node], 0) >> self.index[other] & 1)


def _intersection(masks: Iterable[int]) -> int:
    found = -1
    for mask in masks:
        found &= mask
    return found
