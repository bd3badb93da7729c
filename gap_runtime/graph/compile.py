"""Compiles a validated workflow: references become slots, scripts are loaded, literals get their types."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.failures import DocumentError, PrivilegedReadError, UnknownNameError
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.tool import Tool
from gap_runtime.graph.bind import ReferenceScope, constant, is_constant, make_reader
from gap_runtime.graph.callees import find_skill, script_callee, tool_callee, unknown_input
from gap_runtime.graph.compiled import (
    DEFAULT_VISITS,
    BoundCallable,
    CompiledGraph,
    CompiledNode,
    CompiledSubgraph,
    Reader,
    TopNode,
)
from gap_runtime.graph.model import END, START, Exit, Node, SubgraphDef, Workflow
from gap_runtime.graph.references import STREAM
from gap_runtime.graph.scripts import read_signature
from gap_runtime.graph.topology import Topology, make_topology
from gap_runtime.graph.values import Check, require_finite


def compile_workflow(
    workflow: Workflow,
    folder: Path,
    tools: Mapping[str, Tool],
    skills: Mapping[str, SkillContract],
    canonical: Mapping[str, Path],
) -> CompiledGraph:
    """Make a workflow runnable.

    `folder` holds its scripts. `canonical` maps a script path, or the name of an atomic skill, to the trusted file
    that serves it; every other script is left to the jail. Raises `UnknownNameError` or `DocumentError` where the
    workflow asks for something that is not there: run the validator first, it finds everything at once.
    """
    return _Compiler(workflow, folder, tools, skills, canonical).graph()


class _Compiler:
    def __init__(
        self,
        workflow: Workflow,
        folder: Path,
        tools: Mapping[str, Tool],
        skills: Mapping[str, SkillContract],
        canonical: Mapping[str, Path],
    ) -> None:
        self.workflow, self.folder, self.skills, self.canonical = workflow, folder, skills, canonical
        self.callees: dict[str, BoundCallable] = {name: tool_callee(tool) for name, tool in tools.items()}
        self.sources: dict[str, str] = {}
        for name, contract in skills.items():
            if contract.kind == "atomic" and name in canonical:
                self.callees[name] = self._script(name, canonical[name], self._allowed(contract), trusted=True)

    def graph(self) -> CompiledGraph:
        """The whole workflow."""
        workflow = self.workflow
        topology = make_topology(tuple(workflow.nodes), workflow.edges, workflow.conditional_edges, "the top level")
        nodes = tuple(self._top(name, i, topology) for i, name in enumerate(topology.names))
        return CompiledGraph(workflow, nodes, topology.entries, self.callees, self.sources)

    def _top(self, name: str, index: int, topology: Topology) -> TopNode:
        node = self.workflow.nodes[name]
        subgraph = self._subgraph(name, node) if node.type == "subgraph" else None
        recovery = self._recovery(name, node) if node.type == "end" and node.recovery else None
        status = (node.status or "success") if node.type == "end" else None
        return TopNode(**_step(topology, index, name, node), subgraph=subgraph, status=status, recovery=recovery)

    def _subgraph(self, name: str, node: Node) -> CompiledSubgraph:
        if node.ref not in self.workflow.subgraphs:
            raise UnknownNameError(f"subgraph (node {name})", str(node.ref), self.workflow.subgraphs)
        definition = self.workflow.subgraphs[node.ref]
        found = find_skill(self.skills, definition.skill)
        if found is None:
            raise UnknownNameError("skill", definition.skill, self.skills)
        topology = make_topology(tuple(definition.nodes), definition.edges, definition.conditional_edges, name)
        scope = _scope(name, definition, found[1], topology)
        allowed = self._allowed(found[1])
        nodes = tuple(self._node(definition, n, i, topology, scope, allowed) for i, n in enumerate(topology.names))
        outputs = tuple(
            (key, make_reader(value, scope, f"{name}.outputs.{key}")) for key, value in definition.outputs.items()
        )
        field = definition.exit.router_field
        return CompiledSubgraph(
            node.ref, definition.skill, nodes, topology.entries, tuple(definition.inputs), outputs,
            tuple(field.split(".")) if field else None, frozenset(definition.exit.success_values),
            definition.on_error or found[1].exits.failure,
            streams=any(n.streaming for n in nodes),
        )  # fmt: skip

    def _node(
        self,
        definition: SubgraphDef,
        name: str,
        index: int,
        topology: Topology,
        scope: ReferenceScope,
        allowed: frozenset[str],
    ) -> CompiledNode:
        node = definition.nodes[name]
        where = f"{scope.path}/{name}"
        callee = self._callee(node, where, allowed)
        constants, readers = _inputs(callee, node.inputs, scope, where)
        return CompiledNode(
            **_step(topology, index, where, node),
            kind=node.type if node.type in ("tool", "script", "router") else "noop",  # type: ignore[arg-type]
            callee=callee,
            constants=constants,
            readers=readers,
            effect=callee.effect if callee else "pure",
            resources=_resources(callee, constants, readers),
            deadline_s=node.deadline_s or (callee.deadline_s if callee else 0.0),
            streaming=node.streaming,
        )

    def _allowed(self, contract: SkillContract) -> frozenset[str]:
        """The contract's tools under the names they are served by."""
        return frozenset(name if name in self.callees else name.replace("_", "-") for name in contract.tools)

    def _callee(self, node: Node, where: str, allowed: frozenset[str]) -> BoundCallable | None:
        if node.type == "tool":
            return self._tool(node.tool or "", where)
        if node.type in ("script", "router"):
            path = node.script or ""
            trusted = path in self.canonical
            return self._script(path, self.canonical[path] if trusted else self.folder / path, allowed, trusted=trusted)
        if node.type == "noop":
            return None
        raise DocumentError(where, f"a node of type {node.type!r} cannot stand here")

    def _tool(self, name: str, where: str) -> BoundCallable:
        callee = self.callees.get(name) or self.callees.get(name.replace("_", "-"))
        if callee is None:
            raise UnknownNameError(f"tool (node {where})", name, self.callees)
        if callee.privileged:
            raise PrivilegedReadError(f"Node {where!r} calls {name}, which reads what only the simulator knows.")
        return callee

    def _script(self, name: str, file: Path, allowed: frozenset[str], *, trusted: bool) -> BoundCallable:
        text = read_text(file)
        self.sources[name] = text
        return script_callee(name, read_signature(text, str(file)), file, allowed, self.callees, trusted=trusted)

    def _recovery(self, name: str, node: Node) -> CompiledSubgraph:
        """The calls of an end node as a chain in which an error stops nothing."""
        steps = [f"{i:02d}.{call.tool}" for i, call in enumerate(node.recovery)]
        calls = dict(zip(steps, (Node(type="tool", tool=c.tool, inputs=c.inputs) for c in node.recovery), strict=True))
        definition = SubgraphDef(skill="", nodes=calls, exit=Exit(success_values=[]), on_error="")
        topology = make_topology(steps, list(zip([START, *steps], [*steps, END], strict=True)), {}, name)
        scope = ReferenceScope(name, topology.index, frozenset(), {}, {})
        nodes = tuple(self._node(definition, s, i, topology, scope, frozenset()) for i, s in enumerate(topology.names))
        return CompiledSubgraph(
            name, "", nodes, topology.entries, (), (), None, frozenset(), "", streams=False, tolerant=True
        )


def _step(topology: Topology, index: int, path: str, node: Node) -> dict[str, Any]:
    return {
        "index": index,
        "name": topology.names[index],
        "path": path,
        "successors": topology.successors[index],
        "ends": index in topology.ends,
        "routes": topology.routes.get(index),
        "waits_for": topology.waits_for[index],
        "looped": index in topology.looped,
        "max_visits": node.max_visits or DEFAULT_VISITS,
    }


def _scope(path: str, definition: SubgraphDef, contract: SkillContract, topology: Topology) -> ReferenceScope:
    defaults = {name: parameter.default for name, parameter in contract.parameters.items()}
    streaming = frozenset(name for name, node in definition.nodes.items() if node.streaming)
    parameters = {**defaults, **definition.parameters}
    return ReferenceScope(path, topology.index, streaming, definition.inputs, parameters)


def _inputs(
    callee: BoundCallable | None, inputs: Mapping[str, Any], scope: ReferenceScope, where: str
) -> tuple[dict[str, Any], tuple[tuple[str, Reader, Check], ...]]:
    """Split a node's inputs into those known now, checked, and those read when it starts."""
    constants: dict[str, Any] = {}
    readers: list[tuple[str, Reader, Check]] = []
    for name, data in inputs.items() if callee else ():
        assert callee is not None
        if name not in callee.checks:
            raise unknown_input(callee, name)
        check, place = callee.checks[name], f"{where}.{name}"
        if is_constant(data):
            constants[name] = check(constant(data, scope, place), place)
            require_finite(constants[name], place)
        else:
            type_ = next(p.type for p in callee.arguments if p.name == name)
            live = name == STREAM and type_.name == "any" and not callee.jailed
            readers.append((name, make_reader(data, scope, place, live=live), check))
    return constants, tuple(readers)


def _resources(callee: BoundCallable | None, constants: Mapping[str, Any], readers: tuple[Any, ...]) -> tuple[str, ...]:
    """The resources a node will hold, as far as they can be known before it runs."""
    if callee is None:
        return ()
    read = {name for name, _, _ in readers}
    known = {p.name: p.default for p in callee.arguments if p.name not in read} | dict(constants)
    try:
        return tuple(r.format(**known) for r in callee.resources)
    except KeyError:
        return tuple(r for r in callee.resources if "{" not in r)
