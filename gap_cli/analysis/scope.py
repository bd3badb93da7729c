"""One subgraph as the rules see it: its definition, its skill, what its nodes call, and how control flows."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from gap_cli.analysis.catalog import Callee, Catalog
from gap_cli.analysis.exit_flow import Ways
from gap_cli.analysis.value_types import ANY, Shape, output_shape
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.concurrency import Beside
from gap_runtime.graph.control_flow import Flow
from gap_runtime.graph.findings import Finding
from gap_runtime.graph.model import Node, SubgraphDef, Workflow
from gap_runtime.graph.names import contract_names, infer_names
from gap_runtime.graph.walks import references_in


class Scope:
    """Everything rules ask about one subgraph definition, worked out once."""

    def __init__(self, name: str, definition: SubgraphDef, catalog: Catalog) -> None:
        self.name, self.definition, self.catalog = name, definition, catalog
        self.path = f"subgraphs.{name}"
        self.contract: SkillContract | None = catalog.skill(definition.skill)
        self.callees: dict[str, Callee | None] = {
            n: catalog.callee(node, self.contract) for n, node in definition.nodes.items()
        }

    def find(self, code: str, path: str, message: str, hint: str = "") -> Finding:
        """A finding below this subgraph."""
        return Finding(f"{self.path}.{path}" if path else self.path, code, message, hint)

    @property
    def nodes(self) -> dict[str, Node]:
        """The definition's nodes."""
        return self.definition.nodes

    @cached_property
    def routers(self) -> frozenset[str]:
        """Nodes of type router."""
        return frozenset(n for n, node in self.nodes.items() if node.type == "router")

    @cached_property
    def fan_outs(self) -> frozenset[str]:
        """Routers that may send: their script returns a list, or does not say."""
        outputs = {n: self.callees[n].output for n in self.routers if self.callees[n]}  # type: ignore[union-attr]
        return frozenset(n for n, t in outputs.items() if t is None or t.is_list or t.name == "any")

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
    def flow(self) -> Flow:
        """How control flows."""
        d = self.definition
        return Flow(d.nodes, d.edges, d.conditional_edges, self.fan_outs)

    @cached_property
    def beside(self) -> Beside:
        """What can run at the same time."""
        return Beside(self.flow)

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
    def inputs(self) -> dict[str, Shape]:
        """What `in.<name>` is: the skill's type where it has one, else the declared one."""
        known = self.contract_types[0]
        found = {}
        for name, text in self.definition.inputs.items():
            try:
                found[name] = Shape(known.get(name) or TypeRef.parse(text))
            except ValueError:
                found[name] = Shape(ANY)
        return found

    @cached_property
    def outputs(self) -> dict[str, Shape | None]:
        """What each node gives; None for nothing, `any` where what it calls is not known."""
        return {n: self._output(n) for n in self.nodes}

    def _output(self, name: str) -> Shape | None:
        if name in self.fan_outs:
            return Shape(TypeRef("any", is_list=True))
        callee = self.callees[name]
        if callee is None:
            return None if self.nodes[name].type == "noop" else Shape(ANY)
        return output_shape(callee)

    def surely_before(self, node: str, other: str) -> bool:
        """True when what `other` gives is always there when `node` starts."""
        started = self.flow.surely_started if other in self.streaming else self.flow.surely_before
        return started(node, other)

    def given_at(self, terminal: str, node: str) -> bool:
        """True when what `node` gives is always there once the subgraph ended at `terminal`."""
        return terminal == node or self.surely_before(terminal, node)

    def exits_at(self, terminal: str) -> list[str]:
        """The success exits a terminal node can mean."""
        values = self.definition.exit.success_values
        return [v for v in values if v == terminal] if self.definition.exit.router_field is None else list(values)

    def gives(self, exit_value: str) -> frozenset[str]:
        """Outputs that are always there after this success exit."""
        return self._gives.get(exit_value, frozenset())

    @cached_property
    def _gives(self) -> dict[str, frozenset[str]]:
        sources = {
            name: {r.name for _, r in references_in(value, "") if r is not None and r.source == "node"}
            for name, value in self.definition.outputs.items()
        }
        found: dict[str, frozenset[str]] = {}
        for terminal in self.terminals:
            there = frozenset(
                name
                for name, nodes in sources.items()
                if all(n in self.nodes and self.given_at(terminal, n) for n in nodes)
            )
            for value in self.exits_at(terminal):
                found[value] = found.get(value, there) & there
        return found


class Whole:
    """The workflow and its subgraphs, for rules about the top level."""

    def __init__(self, workflow: Workflow, catalog: Catalog) -> None:
        self.workflow, self.catalog = workflow, catalog
        self.scopes = {name: Scope(name, d, catalog) for name, d in workflow.subgraphs.items()}

    @cached_property
    def flow(self) -> Flow:
        """How control flows from subgraph to subgraph."""
        w = self.workflow
        return Flow(w.nodes, w.edges, w.conditional_edges)

    @cached_property
    def ways(self) -> Ways:
        """How control flows from exit to exit."""
        return Ways(self.workflow)

    def scope_of(self, node: str) -> Scope | None:
        """The scope of the definition a top-level node refers to."""
        found = self.workflow.nodes.get(node)
        return self.scopes.get(found.ref) if found is not None and found.type == "subgraph" and found.ref else None

    def subgraph_nodes(self) -> Iterator[tuple[str, Scope]]:
        """Top-level subgraph nodes whose definition exists."""
        for name in self.workflow.nodes:
            scope = self.scope_of(name)
            if scope is not None:
                yield name, scope
