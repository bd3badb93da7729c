"""One subgraph as the rules see it: its definition, its skill, what its nodes call, and how control flows."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from gap_cli.analysis.catalog import Catalog, Signature, contract_names, infer_names
from gap_cli.analysis.concurrency import MayHappenInParallel
from gap_cli.analysis.exit_flow import ExitFlowGraph
from gap_cli.analysis.must_execute import MustExecute
from gap_cli.analysis.value_types import ANY, StaticType, output_type
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import Finding
from gap_runtime.graph.control_flow import ControlFlowGraph
from gap_runtime.graph.model import Node, SubgraphDef, Workflow
from gap_runtime.graph.references import references_in

SENDS = TypeRef("any", is_list=True)  # what a router returns that starts several nodes
_NOTHING: tuple[frozenset[str], frozenset[str]] = (frozenset(), frozenset())


class SubgraphContext:
    """Everything rules ask about one subgraph definition, worked out once."""

    def __init__(self, name: str, definition: SubgraphDef, catalog: Catalog) -> None:
        self.name, self.definition, self.catalog = name, definition, catalog
        self.path = f"subgraphs.{name}"
        self.contract: SkillContract | None = catalog.skill(definition.skill)
        self.callees: dict[str, Signature | None] = {
            n: catalog.callee(node, self.contract) for n, node in definition.nodes.items()
        }

    def finding(self, code: str, path: str, message: str, hint: str = "") -> Finding:
        """A finding below this subgraph."""
        return Finding(f"{self.path}.{path}" if path else self.path, code, message, hint)

    @property
    def nodes(self) -> dict[str, Node]:
        """The definition's nodes."""
        return self.definition.nodes

    @cached_property
    def on_error(self) -> str:
        """The failure exit: the declared one, or the skill's; '' where neither is known."""
        return self.definition.on_error or (self.contract.exits.failure if self.contract is not None else "")

    @cached_property
    def fan_outs(self) -> frozenset[str]:
        """Routers that may start several nodes: their script returns a list."""
        callees = {n: self.callees[n] for n, node in self.nodes.items() if node.type == "router"}
        return frozenset(n for n, c in callees.items() if c is not None and c.output == SENDS)

    @cached_property
    def copied(self) -> dict[str, str]:
        """Nodes of which a fan-out may start copies -> the router that does."""
        routing = self.definition.conditional_edges
        return {t: r for r in sorted(self.fan_outs) if r in routing for t in routing[r].mapping.values()}

    @cached_property
    def streaming(self) -> frozenset[str]:
        """Nodes that publish while others run."""
        return frozenset(n for n, node in self.nodes.items() if node.streaming)

    @cached_property
    def flow(self) -> ControlFlowGraph:
        """How control flows."""
        d = self.definition
        return ControlFlowGraph(d.nodes, d.edges, d.conditional_edges, self.fan_outs)

    @cached_property
    def must(self) -> MustExecute:
        """What must have run before a node."""
        return MustExecute(self.flow)

    @cached_property
    def parallel(self) -> MayHappenInParallel:
        """What can run at the same time."""
        return MayHappenInParallel(self.flow)

    @cached_property
    def terminals(self) -> list[str]:
        """Nodes an edge of which leads to END, sorted."""
        flow = self.flow
        return sorted({flow.names[flow.arcs[n].source] for n in flow.into[1]} - {"START"})

    @cached_property
    def names(self) -> dict[str, str]:
        """Name substitutions, the slot of the skill's names inferred where the graph leaves it out."""
        d = self.definition
        return {} if self.contract is None else infer_names(self.contract, d.names, [*d.inputs, *d.outputs])

    @cached_property
    def contract_types(self) -> tuple[dict[str, TypeRef], dict[str, TypeRef]]:
        """The skill's inputs and outputs after substitution."""
        return ({}, {}) if self.contract is None else contract_names(self.contract, self.names)

    @cached_property
    def inputs(self) -> dict[str, StaticType]:
        """What `in.<name>` is: the skill's type where it has one, else the declared one."""
        known = self.contract_types[0]
        found = {}
        for name, text in self.definition.inputs.items():
            try:
                found[name] = StaticType(known.get(name) or TypeRef.parse(text))
            except ValueError:
                found[name] = StaticType(ANY)
        return found

    @cached_property
    def outputs(self) -> dict[str, StaticType | None]:
        """What each node gives; None for nothing, `any` where what it calls is not known."""
        return {n: self._output(n) for n in self.nodes}

    def _output(self, name: str) -> StaticType | None:
        if name in self.fan_outs:
            return StaticType(SENDS)
        callee = self.callees[name]
        if callee is None:
            return None if self.nodes[name].type == "noop" else StaticType(ANY)
        return output_type(callee)

    def must_precede(self, node: str, other: str) -> bool:
        """True when what `other` gives is always there when `node` starts."""
        started = self.must.started_before if other in self.streaming else self.must.before
        return started(node, other)

    def given_at(self, terminal: str, node: str) -> bool:
        """True when what `node` gives is always there once the subgraph ended at `terminal`."""
        return terminal == node or self.must_precede(terminal, node)

    def exits_at(self, terminal: str) -> list[str]:
        """The success exits a terminal node can mean."""
        values = self.definition.exit.success_values
        return [v for v in values if v == terminal] if self.definition.exit.router_field is None else list(values)

    def gives(self, exit_value: str) -> frozenset[str]:
        """Outputs that are always there after this success exit."""
        return self._given.get(exit_value, _NOTHING)[0]

    def may_give(self, exit_value: str) -> frozenset[str]:
        """Outputs that can be there after this success exit."""
        return self._given.get(exit_value, _NOTHING)[1]

    @cached_property
    def _given(self) -> dict[str, tuple[frozenset[str], frozenset[str]]]:
        sources = {
            name: {r.name for _, r in references_in(value) if r is not None and r.source == "node"} & self.nodes.keys()
            for name, value in self.definition.outputs.items()
        }
        found: dict[str, tuple[frozenset[str], frozenset[str]]] = {}
        for terminal in self.terminals:
            always = frozenset(n for n, nodes in sources.items() if all(self.given_at(terminal, m) for m in nodes))
            may = frozenset(n for n, nodes in sources.items() if all(self._may_be_given_at(terminal, m) for m in nodes))
            for value in self.exits_at(terminal):
                before = found.get(value, (always, may))
                found[value] = (before[0] & always, before[1] | may)
        return found

    def _may_be_given_at(self, terminal: str, node: str) -> bool:
        return terminal == node or node in self.streaming or self.flow.may_precede(terminal, node)


class WorkflowContext:
    """The workflow and its subgraphs, for rules about the top level."""

    def __init__(self, workflow: Workflow, catalog: Catalog) -> None:
        self.workflow, self.catalog = workflow, catalog
        self.subgraphs = {name: SubgraphContext(name, d, catalog) for name, d in workflow.subgraphs.items()}

    @cached_property
    def flow(self) -> ControlFlowGraph:
        """How control flows from subgraph to subgraph."""
        w = self.workflow
        return ControlFlowGraph(w.nodes, w.edges, w.conditional_edges)

    @cached_property
    def exit_flow(self) -> ExitFlowGraph:
        """How control flows from exit to exit."""
        return ExitFlowGraph(self.workflow)

    def subgraph_of(self, node: str) -> SubgraphContext | None:
        """The sg of the definition a top-level node refers to."""
        found = self.workflow.nodes.get(node)
        return self.subgraphs.get(found.ref) if found is not None and found.type == "subgraph" and found.ref else None

    def subgraph_nodes(self) -> Iterator[tuple[str, SubgraphContext]]:
        """Top-level subgraph nodes whose definition exists."""
        for name in self.workflow.nodes:
            sg = self.subgraph_of(name)
            if sg is not None:
                yield name, sg
