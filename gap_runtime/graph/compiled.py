"""A graph ready to run: names are slots, references are readers, every callable carries its contract."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Literal

from gap_runtime.contracts.tool import Effect, Param
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.model import Workflow
from gap_runtime.graph.values import Check

if TYPE_CHECKING:
    from gap_runtime.run.activation import Frame
    from gap_runtime.run.attempt import Attempt
    from gap_runtime.run.context import NodeContext

DEFAULT_VISITS = 100
SCRIPT_DEADLINE_S = 60.0
Kind = Literal["tool", "script", "router", "noop"]


class _Unset:
    def __repr__(self) -> str:
        return "UNSET"


UNSET: Final = _Unset()
Reader = Callable[["Frame", "Attempt | None"], Any]
Invoke = Callable[["NodeContext", dict[str, Any]], Any]


@dataclass(frozen=True, slots=True)
class BoundCallable:
    """A tool or a script with everything needed to call it safely.

    `allowed` are the tools it may call itself. `arguments` are its inputs with defaults; `checks` their types.
    `effect` is the most it may do. `jailed` marks untrusted code, whose inputs and outputs cross a process border.
    """

    name: str
    kind: Literal["tool", "script"]
    arguments: tuple[Param, ...]
    checks: Mapping[str, Check]
    required: frozenset[str]
    output: TypeRef | None
    fields: Mapping[str, TypeRef]
    check_result: Check
    effect: Effect
    resources: tuple[str, ...]
    deadline_s: float
    takes_context: bool
    invoke: Invoke
    allowed: frozenset[str] = frozenset()
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    privileged: bool = False
    streaming: bool = False
    jailed: bool = False


@dataclass(frozen=True, slots=True)
class Routes:
    """Conditional edges: `read` the deciding field of an output (None: the output itself), then value -> node."""

    fields: tuple[str, ...]
    targets: Mapping[str, tuple[int, ...]]
    ends: frozenset[str]


@dataclass(frozen=True, slots=True)
class CompiledStep:
    """What both levels share: a place in a graph, where control goes next, and whom it has to wait for.

    `waits_for` is a bit mask of the nodes that can still lead here; `looped` marks a node that can run again.
    """

    index: int
    name: str
    path: str
    successors: tuple[int, ...]
    ends: bool
    routes: Routes | None
    waits_for: int
    looped: bool
    max_visits: int


@dataclass(frozen=True, slots=True)
class CompiledNode(CompiledStep):
    """A node of a subgraph. `constants` are inputs known now, `readers` those read when it starts."""

    kind: Kind
    callee: BoundCallable | None
    constants: Mapping[str, Any]
    readers: tuple[tuple[str, Reader, Check], ...]
    effect: Effect
    resources: tuple[str, ...]
    deadline_s: float
    streaming: bool


@dataclass(frozen=True, slots=True)
class CompiledSubgraph:
    """One top-level subgraph node with its definition resolved."""

    ref: str
    skill: str
    nodes: tuple[CompiledNode, ...]
    entries: tuple[int, ...]
    inputs: tuple[str, ...]
    outputs: tuple[tuple[str, Reader], ...]
    exit_fields: tuple[str, ...] | None
    success_values: frozenset[str]
    on_error: str
    streams: bool  # it has streaming nodes
    tolerant: bool = False  # a recovery: an error is noted and the next node runs


@dataclass(frozen=True, slots=True)
class TopNode(CompiledStep):
    """A node of the top level: a subgraph, or an end with its status and recovery."""

    subgraph: CompiledSubgraph | None
    status: Literal["success", "failure"] | None
    recovery: CompiledSubgraph | None


@dataclass(frozen=True, slots=True)
class CompiledGraph:
    """A whole workflow, ready for `run_graph`. `sources` holds the text of every script, for people to read."""

    workflow: Workflow
    nodes: tuple[TopNode, ...]
    entries: tuple[int, ...]
    callees: Mapping[str, BoundCallable]
    sources: Mapping[str, str]
    dry: bool = False

    @property
    def name(self) -> str:
        """The workflow's name, or ''."""
        return self.workflow.meta.get("name", "")

    @property
    def jailed(self) -> tuple[str, ...]:
        """Paths of nodes whose script must run in the jail."""
        return tuple(n.path for n in self.inner_nodes() if n.callee is not None and n.callee.jailed)

    def inner_nodes(self) -> tuple[CompiledNode, ...]:
        """Every node of every subgraph."""
        return tuple(n for top in self.nodes if top.subgraph for n in top.subgraph.nodes)
