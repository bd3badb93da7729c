"""The top level exit by exit: which of a subgraph's exits must have been taken where, and what can run side by side."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import permutations

from gap_cli.analysis.concurrency import MayHappenInParallel
from gap_cli.analysis.must_execute import MustExecute, bits
from gap_runtime.graph.control_flow import ControlFlowGraph
from gap_runtime.graph.model import START, Routing, SubgraphDef, Workflow

Link = tuple[str, str]
Exit = tuple[str, str]  # the subgraph node, and the value it ended with


class ExitFlowGraph:
    """A flow in which every exit of a subgraph is a node of its own, between the subgraph and what it leads to.

    The semantics are the interpreter's: an exit leads where the conditional edges say, and a success exit also along
    every plain edge. A failure end stops all that runs, so what leads to one is left out: of a run that still goes on,
    it was not taken.
    """

    def __init__(self, workflow: Workflow) -> None:
        self.workflow = workflow
        failures = {n for n, node in workflow.nodes.items() if node.status == "failure"}
        self.exits: dict[str, Exit] = {}  # by the name of its node
        edges = [(START, b) for a, b in workflow.edges if a == START and b not in failures]
        routing: dict[str, Routing] = {}
        for node, definition in _subgraphs(workflow):
            kept = {}
            for value, targets in exit_targets(workflow, node, definition).items():
                if targets and not failures & set(targets):
                    name = kept[value] = f"{node}\0{value}"
                    self.exits[name] = (node, value)
                    edges += [(name, target) for target in targets]
            if kept:
                routing[node] = Routing(router_field="exit", mapping=kept)
        names = [n for n in workflow.nodes if n not in failures]
        self.flow = ControlFlowGraph([*names, *self.exits], edges, routing)

    @cached_property
    def must(self) -> MustExecute:
        """What must have run before a node."""
        return MustExecute(self.flow)

    @cached_property
    def parallel(self) -> MayHappenInParallel:
        """What can run at the same time."""
        return MayHappenInParallel(self.flow)

    @cached_property
    def forks(self) -> bool:
        """True when anything starts more than one branch."""
        flow = self.flow
        return any(sum(flow.arcs[n].value is None for n in flow.out[node]) > 1 for node in flow.order)

    def describe(self, index: int) -> str:
        """A node of the flow, for a message."""
        name = self.flow.names[index]
        return f"{self.exits[name][0]!r} (exit {self.exits[name][1]!r})" if name in self.exits else repr(name)

    def both_taken(self, one: str, other: str) -> bool:
        """True when two exits (by the names of their nodes) can be taken in the same pass."""
        flow, same_pass = self.flow, self.parallel.same_pass
        arrivals = [flow.into[flow.index[name]][0] for name in (one, other)]
        return bool(same_pass[arrivals[0]] >> arrivals[1] & 1)

    def several_ends(self) -> Iterator[tuple[str, str]]:
        """Pairs of success ends that one run can reach."""
        flow = self.flow
        ends = [n for n, node in self.workflow.nodes.items() if node.status == "success" and flow.index[n] in flow.rank]
        masks = {n: sum(1 << number for number in flow.into[flow.index[n]]) for n in ends}
        for i, one in enumerate(ends):
            for other in ends[i + 1 :]:
                if any(self.parallel.same_pass[number] & masks[other] for number in bits(masks[one])):
                    yield one, other


def exit_targets(workflow: Workflow, node: str, definition: SubgraphDef) -> dict[str, list[str]]:
    """Where each exit of a subgraph node leads: by the conditional edges, a success also along every plain edge."""
    plain = [b for a, b in workflow.edges if a == node]
    routes = workflow.conditional_edges.get(node)
    found = {value: [target] for value, target in routes.mapping.items()} if routes is not None else {}
    for value in definition.exit.success_values:
        found[value] = [*found.get(value, ()), *plain]
    return found


def _subgraphs(workflow: Workflow) -> Iterator[tuple[str, SubgraphDef]]:
    for name, node in workflow.nodes.items():
        definition = workflow.subgraphs.get(node.ref or "")
        if node.type == "subgraph" and definition is not None:
            yield name, definition


def top_links(workflow: Workflow) -> dict[Link, list[str]]:
    """Every link with its exits, plain edges first; a plain edge from a subgraph is for any success."""
    found: dict[Link, list[str]] = {}
    for a, b in workflow.edges:
        node = workflow.nodes.get(a)
        definition = workflow.subgraphs.get(node.ref or "") if node is not None else None
        found.setdefault((a, b), []).extend(definition.exit.success_values if definition is not None else ())
    for a, routing in workflow.conditional_edges.items():
        for value, b in routing.mapping.items():
            exits = found.setdefault((a, b), [])
            exits += [value] if value not in exits else []
    return found


def side_by_side(workflow: Workflow) -> dict[str, list[str]]:
    """For each subgraph node those that may run at the same time, where there are any."""
    exit_flow = ExitFlowGraph(workflow)
    nodes = [n for n, node in workflow.nodes.items() if node.type == "subgraph"] if exit_flow.forks else []
    found: dict[str, list[str]] = {}
    for one, other in permutations(nodes, 2):
        if exit_flow.parallel.may_overlap(one, other):
            found.setdefault(one, []).append(other)
    return found
