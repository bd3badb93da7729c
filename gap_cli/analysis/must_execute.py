"""What must have run before a node starts, whatever is chosen on the way and however branches interleave."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property, reduce
from operator import and_

from gap_runtime.graph.control_flow import ControlFlowGraph


class MustExecute:
    """Must-execute analysis of one graph: dominance and post-dominance where static edges are all taken."""

    def __init__(self, flow: ControlFlowGraph) -> None:
        self.flow = flow
        self._solved: dict[frozenset[int], _Solution] = {}

    def before(self, node: str, other: str) -> bool:
        """True when `other` has always finished when `node` starts."""
        n, o = self.flow.index[node], self.flow.index[other]
        return n in self.flow.rank and bool((self._starts_with(n) & self.flow.before[n]) >> o & 1)

    def one_before(self, node: str, others: Iterable[str]) -> bool:
        """True when at least one of the others has always finished when `node` starts."""
        n = self.flow.index[node]
        earlier = self.flow.before.get(n, 0) & sum(1 << o for o in {self.flow.index[other] for other in others})
        return bool(earlier) and _Solution(self, self._around(n), earlier).one_of_group(n)

    def started_before(self, node: str, stream: str) -> bool:
        """True when the streaming node `stream`, which nothing waits for, has always been started before `node`."""
        n, s = self.flow.index[node], self.flow.index[stream]
        if n not in self.flow.rank or not self._starts_with(n) >> s & 1:
            return False
        sources = {self.flow.arcs[a].source for a in self.flow.into[s]}
        return all(source == 0 or self.flow.before[n] >> source & 1 for source in sources)

    @cached_property
    def endless(self) -> set[int]:
        """Nodes from which control must go back to an earlier one, whatever is chosen: a loop nothing leaves."""
        flow, found = self.flow, set[int]()
        for node in reversed(flow.order):
            arcs = [(flow.arcs[n].value, n in flow.back or flow.arcs[n].target in found) for n in flow.out[node]]
            choice = [goes_back for value, goes_back in arcs if value is not None]
            if any(goes_back for value, goes_back in arcs if value is None) or (choice and all(choice)):
                found.add(node)
        return found

    def _starts_with(self, node: int) -> int:
        """The nodes that must start in every run in which this one does."""
        within = self._around(node) if self.flow.back else frozenset()
        if within not in self._solved:
            self._solved[within] = _Solution(self, within)
        return self._solved[within].must[node]

    def _around(self, node: int) -> frozenset[int]:
        """Heads of the loops that hold this node."""
        return frozenset(head for head, body in self.flow.loops.items() if body >> node & 1)

    @cached_property
    def dominators(self) -> dict[int, int]:
        """For each node, the nodes on every way to it from START, itself included."""
        import networkx as nx  # takes 80 ms, and only a graph with loops needs it

        parents = nx.immediate_dominators(nx.DiGraph((a.source, a.target) for a in self.flow.arcs), 0)
        found = {0: 1}
        for node in self.flow.order[1:]:
            found[node] = found[parents[node]] | 1 << node
        return found


class _Solution:
    """What must start once a node has, in runs that end well: itself, its consequences, and what led to it.

    Who asks matters. Seen from outside a loop, a new pass leads to what every exit of the loop leads to and to what
    lies on the way there. Seen from within (`within`: the heads of the loops that hold the node that asks), it may be
    the first pass, so only what comes after the loop counts. `group` is a mask of nodes asked about as one: a bit of
    its own, beyond those of the nodes, says that one of them must start, whichever it is.
    """

    def __init__(self, analysis: MustExecute, within: frozenset[int], group: int = 0) -> None:
        flow = self.flow = analysis.flow
        self.analysis, self.within, self.group = analysis, within, group
        self._group_bit = 1 << len(flow.names)
        self.after = dict.fromkeys(flow.order, 0)
        changed = True
        while changed:
            changed = False
            self.next_pass: dict[int, int] = {}  # by head of a loop; found anew in every round
            for node in reversed(flow.order):
                mask = self._consequences(node)
                if mask != self.after[node]:
                    self.after[node], changed = mask, bool(flow.back)
        self.must: dict[int, int] = {}
        for node in flow.order:
            sources = [flow.arcs[n].source for n in flow.into[node] if n not in flow.back]
            self.must[node] = self.after[node] | _common(self.must[s] for s in sources if s in self.must)

    def one_of_group(self, node: int) -> bool:
        """True when one of the group must start in every run in which this node does."""
        return bool(self.must[node] & self._group_bit)

    def _grouped(self, mask: int) -> int:
        return mask | self._group_bit if mask & self.group else mask

    def _consequences(self, node: int) -> int:
        mask, choice = self._grouped(1 << node), []
        for number in self.flow.out[node]:
            if self.flow.arcs[number].value is None:
                mask |= self._leads_to(number)
            else:
                choice.append(self._leads_to(number))
        return mask | _common(choice)

    def _leads_to(self, number: int) -> int:
        """What must start once this edge is taken."""
        target = self.flow.arcs[number].target
        return self._new_pass(target) if number in self.flow.back else self.after[target]

    def _new_pass(self, head: int) -> int:
        """What must start once a loop goes round again."""
        if head not in self.next_pass:
            self.next_pass[head] = 0  # loops that are not nested properly (rule R3 has them) may lead back here
            body = self.flow.loops.get(head, 0)
            self.next_pass[head] = _common(self._by_way_out(number, body, head) for number in self._leaving(body))
        return self.next_pass[head]

    def _by_way_out(self, number: int, body: int, head: int) -> int:
        outside = head not in self.within
        passed = self.analysis.dominators[self.flow.arcs[number].source] & body if outside else 0
        return self._leads_to(number) | self._grouped(passed)

    def _leaving(self, body: int) -> Iterator[int]:
        """Edges that lead out of the body of a loop."""
        inside = (i for i in self.flow.order if body >> i & 1)
        return (n for i in inside for n in self.flow.out[i] if not body >> self.flow.arcs[n].target & 1)


def _common(masks: Iterable[int]) -> int:
    """What is in all of the masks; nothing where there are none."""
    return reduce(and_, masks, -1) if (masks := list(masks)) else 0


def bits(mask: int) -> list[int]:
    """Positions of the ones, lowest first."""
    return [i for i, digit in enumerate(reversed(f"{mask:b}")) if digit == "1"]
