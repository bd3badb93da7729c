"""The `$ref` of a workflow: what it names, and the walk into a value that follows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

from gap_runtime.contracts.failures import BadRequestError

KEY = "$ref"
STREAM = "observation_stream"  # an input that is always there
STREAM_TYPES = ("ObservationStream", "Observation")  # as what it may be declared
Source = Literal["node", "in", "param"]


@dataclass(frozen=True)
class Reference:
    """`node.field.0` is source node; `in.target_obb` and `param.speed` name a subgraph's input and a parameter."""

    source: Source
    name: str
    fields: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str) -> Reference:
        """From the text after `$ref`. Raises ValueError when it is none of the forms."""
        if not isinstance(text, str):
            raise ValueError(f"{text!r} is not a reference")
        return cls._parsed(text)

    @classmethod
    @lru_cache(maxsize=4096)
    def _parsed(cls, text: str) -> Reference:
        parts = text.split(".")
        if not all(parts):
            raise ValueError(f"{text!r} is not a reference; write node, node.field.0, in.name or param.name")
        if parts[0] not in ("in", "param"):
            return cls("node", parts[0], tuple(parts[1:]))
        if len(parts) == 1:
            raise ValueError(f"{text!r} names nothing; write {parts[0]}.<name>")
        return cls("in" if parts[0] == "in" else "param", parts[1], tuple(parts[2:]))

    def __str__(self) -> str:
        head = [] if self.source == "node" else [self.source]
        return ".".join([*head, self.name, *self.fields])


def is_reference(data: Any) -> bool:
    """True for `{"$ref": ...}`."""
    return isinstance(data, Mapping) and KEY in data


def has_reference(data: Any) -> bool:
    """True when a reference is anywhere inside."""
    parts = data.values() if isinstance(data, Mapping) else data if isinstance(data, list) else ()
    return is_reference(data) or any(has_reference(part) for part in parts)


def references_in(value: Any, path: str = "") -> Iterator[tuple[str, Reference | None]]:
    """Every reference below `value` with its path, in order; None for one that is malformed."""
    if is_reference(value):
        yield path, parse_reference(value)
    elif isinstance(value, Mapping):
        for name, part in value.items():
            yield from references_in(part, f"{path}.{name}")
    elif isinstance(value, list):
        for i, part in enumerate(value):
            yield from references_in(part, f"{path}.{i}")


def parse_reference(value: Mapping[str, Any]) -> Reference | None:
    """The reference that `{"$ref": ...}` means, or None."""
    try:
        return Reference.parse(value[KEY]) if set(value) == {KEY} else None
    except ValueError:
        return None


def walk(value: Any, fields: Sequence[str], where: str) -> Any:
    """Follow `fields` into a value: a key, an attribute or a list index. Raises `BadRequestError` where one ends."""
    for name in fields:
        value = _step(value, name, where)
    return value


def _step(value: Any, name: str, where: str) -> Any:
    try:
        if isinstance(value, Mapping):
            return value[name]
        if name.isdigit():
            return value[int(name)]
        if not name.startswith("_"):
            return getattr(value, name)
    except (KeyError, IndexError, TypeError, AttributeError):
        pass
    raise BadRequestError("reference", f"{where}: {type(value).__name__} has no {name!r}", hint=_known(value))


def _known(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"It has: {', '.join(map(str, value))}."
    if isinstance(value, (list, tuple)) and not hasattr(value, "_fields"):
        return f"It has {len(value)} items, counted from 0."
    names = getattr(value, "_fields", None) or getattr(value, "__dataclass_fields__", ())
    return f"It has: {', '.join(names)}." if names else ""
