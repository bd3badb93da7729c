"""What both builders share: plain data in, checked at once, and the line of builder code that gave it."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from types import FunctionType
from typing import Any, TypeVar

from gap_runtime.contracts.failures import DocumentError, did_you_mean

MAX_DEPTH = 64
_HERE = __name__.rpartition(".")[0]  # frames of these modules are not the author's


T = TypeVar("T")


def says_what_it_takes(cls: type[T]) -> type[T]:
    """The class, whose public calls answer arguments they do not have with those they have. Raises `DocumentError`."""
    for name, call in list(vars(cls).items()):
        if isinstance(call, FunctionType) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, _checked(call, cls.__name__ if name == "__init__" else name))
    return cls


def _checked(call: Callable[..., Any], name: str) -> Callable[..., Any]:
    signature = inspect.signature(call)
    known = list(signature.parameters)[1:]
    open_ended = any(p.kind is p.VAR_KEYWORD for p in signature.parameters.values())

    @wraps(call)
    def checked(*args: Any, **kwargs: Any) -> Any:
        try:
            signature.bind(*args, **kwargs)
        except TypeError as error:
            strange = next((k for k in kwargs if k not in known and not open_ended), None)
            others = [n for n in known[len(args) - 1 :] if n not in kwargs]
            hint = f"It takes {', '.join(known)}." if strange is None else did_you_mean(strange, others)
            raise DocumentError(f"{name}()", f"has no {strange!r}" if strange else str(error), hint=hint) from None
        return call(*args, **kwargs)

    return checked


@says_what_it_takes
@dataclass(frozen=True)
class Ref:
    """A reference to a value: `Ref("node")`, `Ref("node.field.0")`, `Ref("in.name")`, `Ref("param.name")`."""

    path: str


@says_what_it_takes
class Recorder:
    """Nodes, edges and conditional edges of one graph, each with the line that added it."""

    def __init__(self, name: str) -> None:
        self.name = text(name, "name")
        self.nodes: dict[str, dict[str, Any]] = {}
        self.edges: list[list[str]] = []
        self.conditional_edges: dict[str, dict[str, Any]] = {}
        self.lines: dict[str, int] = {}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        known = [n for n in dir(type(self)) if n.startswith(("add_", "set_", "declare_"))]
        raise DocumentError(f"{type(self).__name__}.{name}", "does not exist", hint=did_you_mean(name, known))

    def add_edge(self, source: str, target: str) -> None:
        """An edge that is always taken. Several from one node run their targets in parallel."""
        edge = [text(source, "add_edge"), text(target, "add_edge")]
        if edge in self.edges:
            raise DocumentError(f"add_edge({source!r}, {target!r})", "this edge is there already")
        self.record(f"edges.{len(self.edges)}")
        self.edges.append(edge)

    def add_conditional_edges(self, source: str, mapping: Mapping[str, str], router_field: str | None = None) -> None:
        """Edges of which one is taken: by the value of `router_field` of the source's output; None from a router."""
        where = f"add_conditional_edges({source!r})"
        if source in self.conditional_edges:
            raise DocumentError(where, "this node has conditional edges already", hint="Give them all in one mapping.")
        if not isinstance(mapping, Mapping) or not mapping:
            raise DocumentError(where, "needs a mapping from values to node names")
        routes = {_key(k, where): text(v, where) for k, v in mapping.items()}
        self.record(f"conditional_edges.{source}")
        field = None if router_field is None else text(router_field, where)
        self.conditional_edges[text(source, where)] = {"router_field": field, "mapping": routes}

    def put(self, name: str, node: dict[str, Any], where: str) -> None:
        """Add a node. Raises `DocumentError` where the name is taken."""
        if text(name, where) in self.nodes:
            raise DocumentError(where, f"node {name!r} is there already", hint="Nodes cannot be changed once added.")
        self.record(f"nodes.{name}")
        self.nodes[name] = node

    def record(self, path: str) -> None:
        """Remember the line of the author's code that is being run."""
        frame = sys._getframe(1)
        while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(_HERE):
            frame = frame.f_back
        self.lines[path] = frame.f_lineno


def text(value: Any, where: str) -> str:
    """The value. Raises `DocumentError` unless it is text."""
    if not isinstance(value, str):
        raise DocumentError(where, f"{value!r:.60} is not text")
    return value


def mapping_of(value: Any, where: str) -> dict[str, Any]:
    """A mapping of plain data, references written as `{"$ref": ...}`. Raises `DocumentError`."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise DocumentError(where, f"{value!r:.60} is not a mapping", hint='Write {"name": value, ...}.')
    return {text(k, where): plain(v, where) for k, v in value.items()}


def plain(value: Any, where: str, depth: int = 0) -> Any:
    """JSON data, references included. Raises `DocumentError` for what no file can hold."""
    if depth > MAX_DEPTH:
        raise DocumentError(where, f"is nested deeper than {MAX_DEPTH} levels")
    if value is None or isinstance(value, (bool, str, int)):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise DocumentError(where, f"{value} is not a finite number")
        return value
    if isinstance(value, Ref):
        return {"$ref": text(value.path, where)}
    if isinstance(value, (list, tuple)):
        return [plain(v, where, depth + 1) for v in value]
    if isinstance(value, Mapping):
        return {text(k, where): plain(v, where, depth + 1) for k, v in value.items()}
    raise DocumentError(
        where,
        f"{value!r:.60} is a {type(value).__name__}",
        hint="A graph holds text, numbers, booleans, lists, mappings and Ref(...).",
    )


def _key(value: Any, where: str) -> str:
    """A value of a routing field as a mapping spells it: True and False as `true` and `false`."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int) else text(value, where)
