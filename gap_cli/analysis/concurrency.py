"""Which edges of a graph can be taken in the same pass, and so which nodes can run at the same time."""

from __future__ import annotations

from functools import cached_property

from gap_cli.analysis.must_execute import bits
from gap_runtime.graph.control_flow import ControlFlowGraph


class MayHappenInParallel:
    """Pairs of edges, and of nodes, over all interleavings of a graph's parallel branches."""

    def __init__(self, flow: ControlFlowGraph) -> None:
        self.flow = flow

    @cached_property
    def same_pass(self) -> list[int]:
        """For each edge, a mask of the edges that can be taken in the same pass.

        Two edges of one choice exclude each other; two of different nodes go together when the later node can be
        reached by an edge that goes with the earlier one, since its own choice is free.
        """
        flow = self.flow
        masks = [0] * len(flow.arcs)
        for node in flow.order:
            arriving = 0
            for number in flow.into[node]:
                if number not in flow.back and flow.arcs[number].source in flow.rank:
                    arriving |= masks[number] | 1 << number
            leaving = 0
            for number in flow.out[node]:
                leaving |= 1 << number
                masks[number] |= arriving | self._siblings(node, number)
            for number in bits(arriving):
                masks[number] |= leaving
        return masks

    def _siblings(self, node: int, number: int) -> int:
        """Other edges of the node that can be taken with this one."""
        arcs, mask = self.flow.arcs, 0
        choice = node not in self.flow.fan_out and arcs[number].value is not None
        for other in self.flow.out[node]:
            if other != number and not (choice and arcs[other].value is not None):
                mask |= 1 << other
        return mask

    @cached_property
    def _arrivals(self) -> dict[int, int]:
        flow = self.flow
        return {
            node: sum(1 << n for n in flow.into[node] if n not in flow.back and flow.arcs[n].source in flow.rank)
            for node in flow.order
        }

    def may_overlap(self, a: str, b: str) -> bool:
        """True when two nodes can run at the same time: in one pass, and neither waits for the other."""
        flow = self.flow
        i, j = flow.index[a], flow.index[b]
        if i not in flow.rank or j not in flow.rank:
            return False
        if i == j:
            return self.repeats(a)
        if flow.before[i] >> j & 1 or flow.before[j] >> i & 1:
            return False
        return any(self.same_pass[n] & self._arrivals[j] or self._arrivals[j] >> n & 1 for n in bits(self._arrivals[i]))

    def repeats(self, name: str) -> bool:
        """True when a fan-out may start several copies of this node."""
        flow = self.flow
        return any(flow.arcs[n].source in flow.fan_out and flow.arcs[n].value is not None
                   for n in flow.into[flow.index[name]])  # fmt: skip

    def restarted_under(self, number: int, streaming: frozenset[int]) -> int | None:
        """What may still go on when back edge `number` starts a new pass of its loop: the target of an edge that was
        taken in this pass, or END (1); None where all that began in the loop has come together before."""
        flow, before = self.flow, self.flow.before
        tail, head = flow.arcs[number].source, flow.arcs[number].target
        for other in bits(self.same_pass[number]):
            source, target = flow.arcs[other].source, flow.arcs[other].target
            if target in streaming or before[source] >> tail & 1:
                continue  # its source waits for the loop, so it has not been taken yet
            if other in flow.back and source != tail:
                continue  # a loop inside this one, which has ended by now, or one beside it
            joined = target == tail or (target != 1 and other not in flow.back and before[tail] >> target & 1)
            inside = source == head or before[source] >> head & 1
            if inside and not joined:
                return target
            apart = target != 1 and not joined and not before[target] >> tail & 1
            if apart and before[target] >> head & 1:
                return target
        return None

    def both_end(self) -> list[tuple[int, int]]:
        """Pairs of nodes that can lead to END in one pass."""
        flow = self.flow
        ends = [n for n in flow.into[1] if flow.arcs[n].source in flow.rank]
        return [
            (flow.arcs[a].source, flow.arcs[b].source)
            for i, a in enumerate(ends)
            for b in ends[i + 1 :]
            if flow.arcs[a].source != flow.arcs[b].source and self.same_pass[a] >> b & 1
        ]
