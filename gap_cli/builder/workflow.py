"""Builder code: how an author, human or model, writes a graph. `spec` holds the topology, one `sg` each subgraph."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gap_cli.builder.assemble import assemble
from gap_cli.builder.lambdas import expression_of
from gap_cli.builder.recorder import Recorder, Ref, mapping_of, plain, says_what_it_takes, text
from gap_runtime.contracts.failures import DocumentError, did_you_mean
from gap_runtime.graph.load import RETIRED, flat_name, migration
from gap_runtime.graph.model import END, START, VERSION

__all__ = ["END", "START", "Ref", "ServiceCall", "Subgraph", "WorkflowSpec", "assemble"]


@says_what_it_takes
@dataclass(frozen=True, init=False)
class ServiceCall:
    """A tool call of a recovery: `ServiceCall("gripper.Open", {})`, or the paper's three arguments
    `ServiceCall("gripper.v1.Gripper", "Open", {})`."""

    tool: str
    inputs: dict[str, Any] = field(default_factory=dict)

    def __init__(
        self, service: str, method: str | Mapping[str, Any] | None = None, inputs: Mapping[str, Any] | None = None
    ) -> None:
        where = f"ServiceCall({service!r})"
        given = inputs if isinstance(method, str) else method if inputs is None else inputs
        name = flat_name(text(service, where), method) if isinstance(method, str) else text(service, where)
        object.__setattr__(self, "tool", name)
        object.__setattr__(self, "inputs", mapping_of(given, where))


@says_what_it_takes
class Subgraph(Recorder):
    """One segment of the task as a state machine: bind it to `sg`."""

    def __init__(self, name: str, skill: str, description: str = "") -> None:
        super().__init__(name)
        self.skill = text(skill, "skill")
        self.description = text(description, "description")
        self.inputs: dict[str, str] = {}
        self.outputs: dict[str, Any] = {}
        self.exits: list[str] = []
        self.router_field: str | None = None
        self.on_error = ""
        self.checkpoints: list[dict[str, Any]] = []

    def add_input(self, name: str, proto_type: str) -> None:
        """An input bound by name to the output of an earlier subgraph."""
        where = f"add_input({name!r})"
        if text(name, where) in self.inputs:
            raise DocumentError(where, "this input is there already")
        self.record(f"inputs.{name}")
        self.inputs[name] = text(proto_type, where)

    def add_node(
        self,
        name: str,
        *,
        type: str,
        tool: str | None = None,
        script: str | None = None,
        inputs: Mapping[str, Any] | None = None,
        streaming: bool = False,
        deadline_s: float | None = None,
        description: str = "",
        **retired: Any,
    ) -> None:
        """A node: `type` is tool, script, router or noop."""
        where = f"add_node({name!r})"
        if type in RETIRED:
            hint = migration(type, {**retired, "tool": tool})
            raise DocumentError(where, f"node type {type!r} is retired.", hint=hint)
        if retired:
            known = ("type", "tool", "script", "inputs", "streaming", "deadline_s", "description")
            strange = next(iter(retired))
            raise DocumentError(where, f"a node has no {strange!r}", hint=did_you_mean(strange, known))
        given = {
            "tool": tool, "script": script, "inputs": mapping_of(inputs, where), "streaming": plain(streaming, where),
            "deadline_s": plain(deadline_s, where), "description": text(description, where),
        }  # fmt: skip
        self.put(name, {"type": text(type, where), **_given(given)}, where)

    def add_exit(self, name: str) -> None:
        """A success exit: a noop of this name, to be reached and to lead to END."""
        where = f"add_exit({name!r})"
        if name in self.nodes:
            raise DocumentError(where, f"node {name!r} is there already", hint="add_exit makes the node itself.")
        self.put(name, {"type": "noop"}, where)
        self.exits.append(name)

    def set_exit_router(self, *, router_field: str, success_values: Sequence[str]) -> None:
        """The exit is read from a field of the terminal node's output instead of being its name."""
        if self.router_field is not None or self.exits:
            raise DocumentError("set_exit_router()", "the exits are set already", hint="Use either this or add_exit.")
        self.record("exit")
        self.router_field = text(router_field, "set_exit_router()")
        self.exits = [text(v, "set_exit_router()") for v in success_values]

    def set_outputs(self, **outputs: Any) -> None:
        """What later subgraphs may read, each bound to a reference."""
        for name, value in outputs.items():
            if name in self.outputs:
                raise DocumentError("set_outputs()", f"{name} is set already")
            self.record(f"outputs.{name}")
            self.outputs[name] = plain(value, f"set_outputs({name}=...)")

    def set_on_error(self, value: str) -> None:
        """The one failure exit, reached when any node raises; never a node, never the target of an edge."""
        if self.on_error:
            raise DocumentError("set_on_error()", f"it is {self.on_error!r} already")
        self.record("on_error")
        self.on_error = text(value, "set_on_error()")

    def add_checkpoint(
        self,
        name: str,
        predicate: str | Callable[..., Any],
        *,
        diagnostics: Mapping[str, str | Callable[..., Any]] | None = None,
        rationale: str = "",
        validate: bool = True,
        weight: float = 1.0,
    ) -> None:
        """What must be true of the world when the subgraph ends: text over `w`, or a lambda of it."""
        where = f"add_checkpoint({name!r})"
        if any(c["name"] == name for c in self.checkpoints):
            raise DocumentError(where, "this checkpoint is there already")
        self.record(f"checkpoints.{name}")
        numbers = {text(k, where): expression_of(v, where) for k, v in (diagnostics or {}).items()}
        point = {
            "name": text(name, where), "predicate": expression_of(predicate, where),
            "rationale": text(rationale, where), "validate": plain(validate, where),
            "weight": plain(weight, where), "diagnostics": numbers,
        }  # fmt: skip
        self.checkpoints.append(point)

    def to_dict(self) -> dict[str, Any]:
        """`{"kind", "name", "def", "checkpoints", "lines"}`: all of it plain data."""
        given = {
            "skill": self.skill, "description": self.description, "inputs": self.inputs, "outputs": self.outputs,
            "nodes": self.nodes, "edges": self.edges, "conditional_edges": self.conditional_edges,
            "exit": {"router_field": self.router_field, "success_values": self.exits}, "on_error": self.on_error,
        }  # fmt: skip
        return {
            "kind": "subgraph", "name": self.name, "def": given, "checkpoints": self.checkpoints, "lines": self.lines,
        }  # fmt: skip


@says_what_it_takes
class WorkflowSpec(Recorder):
    """The topology: which subgraph does which segment, and where each of its exits leads. Bind it to `spec`."""

    def __init__(self, name: str, description: str = "", meta: Mapping[str, str] | None = None) -> None:
        super().__init__(name)
        given = {"name": name, "description": text(description, "description"), **mapping_of(meta, "meta")}
        self.meta = {k: text(v, "meta") for k, v in _given(given).items()}
        self.subgraphs: dict[str, dict[str, Any]] = {}

    def declare_subgraph(
        self,
        name: str,
        *,
        skill: str,
        exit_success_values: Iterable[str],
        on_error: str = "",
        description: str = "",
        inputs: Mapping[str, str] | None = None,
        outputs: Mapping[str, str] | None = None,
        stage: str | None = None,
        names: Mapping[str, str] | None = None,
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        """What a subgraph is for, takes, gives and how it ends; its inside is written separately."""
        where = f"declare_subgraph({name!r})"
        if text(name, where) in self.subgraphs:
            raise DocumentError(where, "this subgraph is declared already")
        self.record(f"subgraphs.{name}")
        if isinstance(exit_success_values, str):
            raise DocumentError(where, "exit_success_values is a list", hint=f"Write [{exit_success_values!r}].")
        self.subgraphs[name] = {
            "skill": text(skill, where), "description": text(description, where),
            "stage": None if stage is None else text(stage, where),
            "inputs": {k: text(v, where) for k, v in mapping_of(inputs, where).items()},
            "outputs": {k: text(v, where) for k, v in mapping_of(outputs, where).items()},
            "exit_success_values": [text(v, where) for v in exit_success_values], "on_error": text(on_error, where),
            "names": {k: text(v, where) for k, v in mapping_of(names, where).items()},
            "parameters": mapping_of(parameters, where),
        }  # fmt: skip

    def add_subgraph_node(self, name: str, *, ref: str, max_visits: int | None = None, description: str = "") -> None:
        """Place a declared subgraph in the graph; `max_visits` is its budget where it lies on a loop."""
        where = f"add_subgraph_node({name!r})"
        given = {"ref": text(ref, where), "max_visits": plain(max_visits, where), "description": description}
        self.put(name, {"type": "subgraph", **_given(given)}, where)

    def add_end(self, name: str, *, status: str, recovery: Sequence[ServiceCall] = (), description: str = "") -> None:
        """An end of the task, `status` success or failure, and the tool calls that make the cell safe on the way."""
        where = f"add_end({name!r})"
        if not all(isinstance(c, ServiceCall) for c in recovery):
            raise DocumentError(where, "recovery is a list of ServiceCall(...)")
        calls = [{"tool": c.tool, **({"inputs": c.inputs} if c.inputs else {})} for c in recovery]
        given = {"status": text(status, where), "recovery": calls, "description": description}
        self.put(name, {"type": "end", **_given(given)}, where)

    def to_dict(self) -> dict[str, Any]:
        """`{"kind", "name", "def", "checkpoints", "lines"}`; `def.subgraphs` holds the declarations."""
        given = {
            "version": VERSION, "meta": self.meta, "nodes": self.nodes, "edges": self.edges,
            "conditional_edges": self.conditional_edges, "subgraphs": self.subgraphs,
        }  # fmt: skip
        return {"kind": "workflow", "name": self.name, "def": given, "checkpoints": [], "lines": self.lines}


def _given(keys: Mapping[str, Any]) -> dict[str, Any]:
    """Without what says nothing: None, False, and empty text, lists and mappings."""
    return {k: v for k, v in keys.items() if v is not None and v is not False and v not in ("", [], {})}
