"""How control can flow through one graph: what surely ran before a node, and what may run beside it.

The semantics are the interpreter's. A node's static edges are all taken; of its conditional edges one is, or from a
fan-out router any number but none. A node that several edges lead to waits for every branch that may still reach it. An
edge back to a node that dominates its source starts a new pass of a loop. Sets of nodes and edges are bit masks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from gap_runtime.graph.model import END, START, Edge, Routing


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

    def leaving(self, body: int) -> list[int]:
        """Edges that lead out of the body of a loop."""
        inside = (i for i in self.order if body >> i & 1)
        return [n for i in inside for n in self.out[i] if not body >> self.arcs[n].target & 1]

    @cached_property
    def irreducible(self) -> frozenset[int]:
        """Back edges whose target does not dominate their source: a loop with two ways in."""
        if not self.back:
            return frozenset()
        return frozenset(n for n in self.back if not self.dominators[self.arcs[n].source] >> self.arcs[n].target & 1)

    @cached_property
    def dominators(self) -> dict[int, int]:
        """For each node, the nodes on every way to it from START, itself included."""
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
        """For each node, the nodes that can lead to it within one pass, and all of a loop it comes after: it waits for
        those of them that run."""
        found: dict[int, int] = {}
        loops = self.loops if self.back else {}
        for node in self.order:
            mask = 0
            for number in self.into[node]:
                source = self.arcs[number].source
                if number not in self.back and source in found:
                    mask |= found[source] | 1 << source
            for head, body in loops.items():
                if mask >> head & 1 and not body >> node & 1:
                    mask |= body
            found[node] = mask
        return found

    def _sure(self, node: int) -> int:
        """The nodes that surely start in every run in which this one does."""
        within = self._around(node)
        if within not in self._certain:
            self._certain[within] = Certain(self, within)
        return self._certain[within].sure[node]

    def _around(self, node: int) -> frozenset[int]:
        """Heads of the loops that hold this node."""
        return frozenset(head for head, body in self.loops.items() if body >> node & 1)

    @cached_property
    def _certain(self) -> dict[frozenset[int], Certain]:
        return {}

    def surely_before(self, node: str, other: str) -> bool:
        """True when `other` has always finished when `node` starts."""
        n, o = self.index[node], self.index[other]
        return n in self.rank and bool((self._sure(n) & self.before[n]) >> o & 1)

    def one_surely_before(self, node: str, others: Iterable[str]) -> bool:
        """True when at least one of the others has always finished when `node` starts."""
        n = self.index[node]
        earlier = sum(1 << o for o in {self.index[other] for other in others} if self.before.get(n, 0) >> o & 1)
        return bool(earlier) and Certain(self, self._around(n), earlier).one_of(n)

    def surely_started(self, node: str, stream: str) -> bool:
        """True when the streaming node `stream`, which nothing waits for, has always been started before `node`."""
        n, s = self.index[node], self.index[stream]
        if n not in self.rank or not self._sure(n) >> s & 1:
            return False
        sources = {self.arcs[a].source for a in self.into[s]}
        return all(source == 0 or self.before[n] >> source & 1 for source in sources)

    def can_precede(self, node: str, other: str) -> bool:
        """True when `other` leads to `node` within one pass."""
        return bool(self.before.get(self.index[node], 0) >> self.index[other] & 1)


class Certain:
    """What surely starts once a node has, in runs that end well: itself, its consequences, and what led to it.

    Who asks matters. Seen from outside a loop, a new pass leads to what every way out of the loop leads to and to what
    lies on the way there. Seen from within (`within`: the heads of the loops that hold the node that asks), it may be
    the first pass, so only what comes after the loop counts. `group` is a mask of nodes asked about as one: a bit of
    its own, beyond those of the nodes, says that one of them surely starts, whichever it is.
    """

    def __init__(self, flow: Flow, within: frozenset[int], group: int = 0) -> None:
        self.flow, self.within, self.group = flow, within, group
        self._group_bit = 1 << len(flow.names)
        self.after = dict.fromkeys(flow.order, 0)
        changed = True
        while changed:
            changed = False
            self.beyond: dict[int, int] = {}  # by head of a loop; found anew in every round
            for node in reversed(flow.order):
                mask = self._consequences(node)
                if mask != self.after[node]:
                    self.after[node], changed = mask, bool(flow.back)
        self.sure: dict[int, int] = {}
        for node in flow.order:
            sources = [flow.arcs[n].source for n in flow.into[node] if n not in flow.back]
            ways = [self.sure[s] for s in sources if s in self.sure]
            self.sure[node] = self.after[node] | (_intersection(ways) if ways else 0)

    def one_of(self, node: int) -> bool:
        """True when one of the group surely starts in every run in which this node does."""
        return bool(self.sure[node] & self._group_bit)

    def _grouped(self, mask: int) -> int:
        return mask | self._group_bit if mask & self.group else mask

    def _consequences(self, node: int) -> int:
        mask, options, any_option = self._grouped(1 << node), -1, False
        for number in self.flow.out[node]:
            reached = self._leads_to(number)
            if self.flow.arcs[number].value is None:
                mask |= reached
            else:
                options, any_option = options & reached, True
        return mask | options if any_option else mask

    def _leads_to(self, number: int) -> int:
        """What surely starts once this edge is taken."""
        target = self.flow.arcs[number].target
        return self._beyond(target) if number in self.flow.back else self.after[target]

    def _beyond(self, head: int) -> int:
        """What surely starts once a loop goes round again."""
        if head not in self.beyond:
            flow, ways = self.flow, []
            self.beyond[head] = 0  # loops that are not nested properly (rule R3 has them) may lead back here
            body = flow.loops.get(head, 0)
            for out in flow.leaving(body):
                on_the_way = flow.dominators[flow.arcs[out].source] & body if head not in self.within else 0
                ways.append(self._leads_to(out) | self._grouped(on_the_way))
            self.beyond[head] = _intersection(ways) if ways else 0
        return self.beyond[head]


def _intersection(masks: Iterable[int]) -> int:
    found = -1
    for mask in masks:
        found &= mask
    return found
