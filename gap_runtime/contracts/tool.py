"""A tool: a contract under a name `<service>.<Method>`, with its effect, resources and deadline, and a provider of it.

The contract is a `ToolRequest` class, which any number of providers serve, or, where there is one provider only, the
signature and docstring of a function. Name, inputs, defaults, outputs and schema hash are derived from it.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import re
import typing
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from typing import Any, ClassVar, Generic, Protocol, TypedDict, TypeVar, Unpack, dataclass_transform

from gap_runtime.contracts.access import Effect
from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.encoding.codec import field_refs, to_plain
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer
from gap_runtime.contracts.types import CONTRACT_TYPES
from gap_runtime.contracts.types.typeref import TypeRef

Result = TypeVar("Result")
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

    @property
    def renderer(self) -> ObjectRenderer:
        """Renders the task's object models. Raises `ToolError` code `no_renderer` where no plugin offers one."""

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
    returns nothing has neither. `resources` are held exclusively while it runs (`arm:0`, `gripper:0`, `clock`); one
    written `arm:{arm_id}` is the one that the call's own input names.
    """

    name: str
    inputs: tuple[Param, ...]
    output: TypeRef | None
    fields: Mapping[str, TypeRef]
    effect: Effect = "pure"
    resources: tuple[str, ...] = ()
    deadline_s: float = 10.0
    privileged: bool = False
    streaming: bool = False
    doc: str = ""

    @property
    def summary(self) -> str:
        """The first line of the docstring."""
        return self.doc.partition("\n")[0]

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
                p.name: {"type": str(p.type)} if p.required else {"type": str(p.type), "default": to_plain(p.default)}
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
    """A contract and who serves it: `call(context, inputs)`; `notes` is what the provider's docstring says about how.

    `plugin` is stamped by the host at registration.
    """

    spec: ToolSpec
    call: Callable[[Any, Mapping[str, Any]], Any] = field(repr=False)
    takes_context: bool
    provider: str = "embedded"
    notes: str = ""
    plugin: str = ""

    def __call__(self, context: ToolContext | None, **inputs: Any) -> Any:
        """Call the provider; a pure one needs no context."""
        return self.call(context, inputs)


class Declared(TypedDict, total=False):
    """What a contract declares beside its types; the defaults are `ToolSpec`'s."""

    effect: Effect
    resources: tuple[str, ...]
    deadline_s: float
    privileged: bool
    streaming: bool


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
class ToolRequest(Generic[Result]):
    """A tool's contract as a subclass, and one request to it as an instance.

    Fields in order are the inputs with their defaults, `Result` is what is returned, and the docstring says what every
    provider keeps to. `__post_init__` may refuse values, for all providers alike. Raises TypeError for what is no
    contract.
    """

    contract: ClassVar[ToolSpec]
    returns: ClassVar[Any]

    def __init_subclass__(cls, *, tool: str, **declared: Unpack[Declared]) -> None:
        doc = inspect.cleandoc(cls.__doc__ or "")
        dataclass(frozen=True, eq=False)(cls)
        hints = typing.get_type_hints(cls, include_extras=True)
        inputs = [Param(f.name, _typeref(hints, f.name, tool), _default(f)) for f in fields(cls)]  # type: ignore[arg-type]
        (cls.returns,) = typing.get_args(cls.__orig_bases__[0]) or (REQUIRED,)  # type: ignore[attr-defined]
        cls.contract = _spec(tool, inputs, cls.returns, doc, declared)


def serves(
    request: type[ToolRequest[Any]], *, provider: str = "embedded", deadline_s: float | None = None
) -> Callable[[Callable[..., Any]], Tool]:
    """Make a `Tool` of `def function(ctx: ToolContext, request: Request) -> Result`; a pure one may leave `ctx` out.

    `deadline_s` may differ from the contract's: how long a call takes is the provider's. Raises TypeError when the
    function takes or returns something else.
    """
    name = request.contract.name

    def decorate(function: Callable[..., Any]) -> Tool:
        hints = typing.get_type_hints(function)
        ctx, taken = _parameters(function)
        if [hints.get(p.name) for p in taken] != [request]:
            raise TypeError(f"{function.__name__} cannot serve {name!r}: it must take one {request.__name__}")
        if hints.get("return", REQUIRED) != _without_frame(request.returns):
            raise TypeError(f"{function.__name__} cannot serve {name!r}: it does not return {request.returns!r}")
        call = (lambda c, i: function(c, request(**i))) if ctx else lambda c, i: function(request(**i))
        spec = request.contract if deadline_s is None else replace(request.contract, deadline_s=deadline_s)
        return Tool(spec, call, ctx, provider, inspect.getdoc(function) or "")

    return decorate


def tool(
    name: str, *, provider: str = "embedded", **declared: Unpack[Declared]
) -> Callable[[Callable[..., Any]], Tool]:
    """Make a `Tool` of a typed function whose signature and docstring are the contract; `ctx` receives the context.

    For a tool that one plugin has to itself. Raises TypeError when the signature is not a contract.
    """

    def decorate(function: Callable[..., Any]) -> Tool:
        hints = typing.get_type_hints(function, include_extras=True)
        ctx, taken = _parameters(function)
        inputs = [Param(p.name, _typeref(hints, p.name, name), p.default) for p in taken]
        spec = _spec(name, inputs, hints.get("return", REQUIRED), inspect.getdoc(function) or "", declared)
        call = (lambda c, i: function(c, **i)) if ctx else lambda c, i: function(**i)
        return Tool(spec, call, ctx, provider)

    return decorate


def _parameters(function: Callable[..., Any]) -> tuple[bool, list[inspect.Parameter]]:
    """True when the function takes a `ctx`, and its other parameters."""
    given = dict(inspect.signature(function).parameters)
    return given.pop("ctx", None) is not None, list(given.values())


def _spec(name: str, inputs: Sequence[Param], returns: Any, doc: str, declared: Declared) -> ToolSpec:
    if not _NAME.match(name):
        raise TypeError(f"tool name {name!r} must look like service.Method")
    if not doc:
        raise TypeError(f"tool {name!r} has no docstring")
    return ToolSpec(name, tuple(inputs), *result_types(returns, name), doc=doc, **declared)


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
    return {name: ref or TypeRef("any") for name, ref in field_refs(cls).items()}


def _typeref(hints: Mapping[str, Any], parameter: str, name: str) -> TypeRef:
    if parameter not in hints:
        raise TypeError(f"tool {name!r}: parameter {parameter!r} has no type")
    return TypeRef.of(hints[parameter])


def _default(f: Any) -> Any:
    if f.default_factory is not MISSING:
        return f.default_factory()
    return REQUIRED if f.default is MISSING else f.default


def _without_frame(annotation: Any) -> Any:
    return typing.get_args(annotation)[0] if typing.get_origin(annotation) is typing.Annotated else annotation
