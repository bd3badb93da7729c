"""A tool: a typed function under a catalogue name, with its effect, the resources it holds and its deadline.

Name, inputs, defaults, outputs and schema hash come from the function's signature and docstring. A tool name is
a contract; the function that serves it is a provider.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import re
import typing
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal, Protocol

from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.types import CONTRACT_TYPES
from gap_runtime.contracts.types.typeref import TypeRef

Effect = Literal["pure", "sense", "actuate"]
REQUIRED = inspect.Parameter.empty
OBSERVED = "observed"  # in `ToolContext.state`: a deque of the last Observations taken from in.observation_stream
_NAME = re.compile(r"^[a-z][a-z0-9_]*\.[A-Z][A-Za-z0-9]*$")


class ToolContext(Protocol):
    """What a tool may use. Everything here is what a real robot cell would offer."""

    task: Task
    state: dict[str, Any]  # per-episode memory of stateful providers (trackers, ...); empty at reset
    seed: int  # of this episode; seed every random choice from it

    @property
    def cell(self) -> Cell:
        """The robot cell."""

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""

    def shared(self, key: str, make: Callable[[], Any]) -> Any:
        """Something immutable derived from the task's models alone, made once per process (never from observations)."""

    def raise_if_cancelled(self) -> None:
        """Raise `CancelledError` when this node was told to stop; call it in long loops."""


class ScriptContext(Protocol):
    """What a skill script may use: tools, the robot's spec, the seed."""

    seed: int

    def tool(self, name: str, /, **inputs: Any) -> Any:
        """Call a tool of the skill's list; its bare value or a NamedTuple. Raises what the tool raises."""

    def robot(self, arm_id: int = 0) -> RobotSpec:
        """The spec of one arm."""

    def publish(self, value: Any) -> None:
        """Make `value` the latest of this streaming node."""

    def raise_if_cancelled(self) -> None:
        """Raise `CancelledError` when this node was told to stop; call it in long loops."""

    def cleanup(self) -> AbstractContextManager[None]:
        """Within it a node that was told to stop may still call tools that move nothing, to free what it holds, until
        it is abandoned: a second for a streaming node. Write it in a `finally`."""


@dataclass(frozen=True)
class Param:
    """One input of a tool or script: its type and its default (`REQUIRED` when there is none)."""

    name: str
    type: TypeRef
    default: Any = REQUIRED

    @property
    def required(self) -> bool:
        """True when the caller must give it."""
        return self.default is REQUIRED


@dataclass(frozen=True)
class ToolSpec:
    """The contract of a tool, apart from who serves it.

    `output` is set when the tool returns one bare value; `fields` when it returns named ones. A tool that
    returns nothing has neither. `resources` are held exclusively while it runs (`arm:0`, `gripper:0`, `clock`).
    """

    name: str
    inputs: tuple[Param, ...]
    output: TypeRef | None
    fields: Mapping[str, TypeRef]
    effect: Effect
    resources: tuple[str, ...]
    deadline_s: float
    privileged: bool
    streaming: bool
    summary: str
    doc: str

    @property
    def service(self) -> str:
        """The part before the dot."""
        return self.name.partition(".")[0]

    @property
    def schema(self) -> dict[str, Any]:
        """Inputs, outputs and effect as plain data; what the schema hash is taken over."""
        return {
            "name": self.name,
            "inputs": {
                p.name: {"type": str(p.type)} if p.required else {"type": str(p.type), "default": _plain(p.default)}
                for p in self.inputs
            },
            "output": str(self.output) if self.output else None,
            "fields": {k: str(v) for k, v in self.fields.items()},
            "effect": self.effect,
            "privileged": self.privileged,
            "streaming": self.streaming,
        }

    @property
    def schema_hash(self) -> str:
        """First 16 hex digits of the sha256 of the canonical schema."""
        text = json.dumps(self.schema, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Tool:
    """A spec and the function that serves it. `plugin` is stamped by the host at registration."""

    spec: ToolSpec
    function: Callable[..., Any] = field(repr=False)
    takes_context: bool
    provider: str = "embedded"
    plugin: str = ""

    def __call__(self, context: ToolContext, **inputs: Any) -> Any:
        """Call the provider."""
        return self.function(context, **inputs) if self.takes_context else self.function(**inputs)

    def stamped(self, plugin: str) -> Tool:
        """This tool, known to come from `plugin`."""
        return replace(self, plugin=plugin)


def tool(
    name: str,
    *,
    effect: Effect = "pure",
    resources: tuple[str, ...] = (),
    deadline_s: float = 10.0,
    privileged: bool = False,
    streaming: bool = False,
    provider: str = "embedded",
) -> Callable[[Callable[..., Any]], Tool]:
    """Make a `Tool` of a typed function; a first parameter named `ctx` receives the `ToolContext`.

    A resource may be written `arm:{arm_id}`: it is then the one the call's own argument names.
    Raises TypeError when the signature is not a contract.
    """

    def decorate(function: Callable[..., Any]) -> Tool:
        if not _NAME.match(name):
            raise TypeError(f"tool name {name!r} must look like service.Method")
        signature = inspect.signature(function)
        hints = typing.get_type_hints(function, include_extras=True)
        takes_context = next(iter(signature.parameters), None) == "ctx"
        inputs = tuple(
            Param(p.name, _typeref(hints, p.name, name), p.default)
            for p in list(signature.parameters.values())[1 if takes_context else 0 :]
        )
        output, out_fields = result_types(hints.get("return", REQUIRED), name)
        doc = inspect.getdoc(function) or ""
        if not doc:
            raise TypeError(f"tool {name!r} has no docstring")
        spec = ToolSpec(
            name, inputs, output, out_fields, effect, tuple(resources), deadline_s, privileged, streaming,
            doc.splitlines()[0], doc,
        )  # fmt: skip
        return Tool(spec, function, takes_context, provider)

    return decorate


def serves(contract: Tool, *, provider: str, deadline_s: float | None = None) -> Callable[[Callable[..., Any]], Tool]:
    """Make another provider of a tool whose contract exists: same name, inputs, defaults, outputs and effect.

    A docstring of the function's own says how this provider does it; without one the contract's stands. `deadline_s`
    may differ: how long a call takes is the provider's. Raises TypeError when the inputs' names, or a declared return,
    are not the contract's.
    """

    def decorate(function: Callable[..., Any]) -> Tool:
        given = list(inspect.signature(function).parameters)
        takes_context = given[:1] == ["ctx"]
        wanted = [p.name for p in contract.spec.inputs]
        if given[1 if takes_context else 0 :] != wanted:
            raise TypeError(
                f"{function.__name__}({', '.join(given)}) cannot serve {contract.spec.name!r}, "
                f"whose inputs are {', '.join(wanted)}"
            )
        returned = typing.get_type_hints(function, include_extras=True).get("return", REQUIRED)
        if returned is not REQUIRED:
            output, out_fields = result_types(returned, contract.spec.name)
            if (output, out_fields) != (contract.spec.output, dict(contract.spec.fields)):
                raise TypeError(f"{function.__name__} cannot serve {contract.spec.name!r}: it returns something else")
        doc = inspect.getdoc(function) or contract.spec.doc
        seconds = contract.spec.deadline_s if deadline_s is None else deadline_s
        spec = replace(contract.spec, deadline_s=seconds, summary=doc.splitlines()[0], doc=doc)
        return Tool(spec, function, takes_context, provider)

    return decorate


def result_types(annotation: Any, name: str) -> tuple[TypeRef | None, dict[str, TypeRef]]:
    """Split a return annotation into a bare output type or named field types.

    NamedTuples, TypedDicts and dataclasses that are not contract types give fields; contract types are bare.
    """
    if annotation is REQUIRED:
        raise TypeError(f"tool {name!r} does not say what it returns")
    if annotation in (None, type(None)):
        return None, {}
    bundle = isinstance(annotation, type) and annotation not in CONTRACT_TYPES.values()
    if bundle and (hasattr(annotation, "_fields") or hasattr(annotation, "__total__") or is_dataclass(annotation)):
        hints = typing.get_type_hints(annotation, include_extras=True)
        names = [f.name for f in fields(annotation)] if is_dataclass(annotation) else list(hints)
        return None, {n: TypeRef.of(hints[n]) for n in names}
    return TypeRef.of(annotation), {}


def field_types(type_: TypeRef) -> dict[str, TypeRef]:
    """The fields one may walk into on a contract type, with their types; empty for scalars, lists and `any`."""
    cls = CONTRACT_TYPES.get(type_.name)
    if cls is None or type_.is_list:
        return {}
    hints = typing.get_type_hints(cls, include_extras=True)
    found: dict[str, TypeRef] = {}
    for f in fields(cls):
        try:
            found[f.name] = TypeRef.of(hints[f.name])
        except TypeError:
            found[f.name] = TypeRef("any")
    return found


def _typeref(hints: Mapping[str, Any], parameter: str, name: str) -> TypeRef:
    if parameter not in hints:
        raise TypeError(f"tool {name!r}: parameter {parameter!r} has no type")
    return TypeRef.of(hints[parameter])


def _plain(value: Any) -> Any:
    from gap_runtime.contracts.encoding.codec import to_plain

    return to_plain(value)
