"""A graph ready to run: names are slots, references are readers, every callable carries its contract."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, Protocol

from gap_runtime.contracts.access import Effect
from gap_runtime.contracts.tool import Param
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.model import Workflow
from gap_runtime.graph.values import Check

DEFAULT_VISITS = 100
SCRIPT_DEADLINE_S = 60.0
Kind = Literal["tool", "script", "router", "noop"]


class _Unset:
    def __repr__(self) -> str:
        return "UNSET"


UNSET: Final = _Unset()


class StreamOwner(Protocol):
    """Who reads a stream: a node, which may be told to stop while it waits."""

    def check(self) -> None:
        """Raise `CancelledError` or `ToolError` where it must not go on."""

    @property
    def paces_cell(self) -> bool:
        """True while the cell may wait for it."""


class ValueStream(Protocol):
    """Values of which the newest counts."""

    @property
    def count(self) -> int:
        """How many items were published so far."""

    def latest(self, owner: StreamOwner | None = None) -> Any:
        """The newest value. Raises `ToolError` code `stream` where there is none and none will come."""

    def reader(self, owner: StreamOwner, seen: int = 0) -> Any:
        """A place in the stream for one node, after the first `seen` items."""


class ActivationValues(Protocol):
    """What the references of a subgraph read while it is passed through; `slots` hold each node's output by index."""

    @property
    def slots(self) -> Sequence[Any]:
        """Outputs, `UNSET` where a node has not run."""

    @property
    def inputs(self) -> Mapping[str, Any]:
        """The subgraph's inputs, as far as they were produced."""

    @property
    def streams(self) -> Mapping[int, ValueStream]:
        """What streaming nodes publish, by index."""

    @property
    def observations(self) -> Callable[[], ValueStream]:
        """Makes the cell's own stream, once it is asked for."""


class CallContext(Protocol):
    """What a callable is handed for one call, as far as the graph knows it."""

    def raise_if_cancelled(self) -> None:
        """Raise `CancelledError` or `ToolError` where the node must not go on."""

    def seconds_left(self) -> float:
        """Wall seconds until the node's deadline."""

    def run_jailed(self, file: Path, inputs: dict[str, Any]) -> Any:
        """Run an untrusted script."""


Reader = Callable[[ActivationValues, StreamOwner | None], Any]
Invoke = Callable[[Any, dict[str, Any]], Any]
"""(CallContext, or None where it takes none; inputs by name) -> output."""


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
