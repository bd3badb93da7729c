"""Values at the border of a node: checked against their type, finite where a robot would act on them, never shared."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np

from gap_runtime.contracts.encoding.codec import from_plain
from gap_runtime.contracts.failures import BadRequestError, did_you_mean
from gap_runtime.contracts.types import CONTRACT_TYPES, DepthImage, Value
from gap_runtime.contracts.types.typeref import TypeRef

Check = Callable[[Any, str], Any]


@cache
def make_check(ref: TypeRef) -> Check:
    """A function that returns a value of type `ref` (plain data decoded), or raises `BadRequestError` saying where."""
    cls = None if ref.is_list else CONTRACT_TYPES.get(ref.name)

    def check(value: Any, where: str) -> Any:
        if cls is not None and type(value) is cls:
            return value
        return read_only(from_plain(value, ref, where=where))

    return check


def make_result_check(name: str, output: TypeRef | None, named: Mapping[str, TypeRef]) -> Check:
    """A function that checks what a tool or script returned: None, one bare value, or a NamedTuple of its fields."""
    if output is not None:
        return make_check(output)
    if not named:
        return lambda value, where: None
    checks = {field: make_check(ref) for field, ref in named.items()}
    optional = {field for field, ref in named.items() if ref.optional or ref.name == "any"}
    record: Any = namedtuple(_identifier(name), list(named))  # type: ignore[misc]

    def check(value: Any, where: str) -> Any:
        given = _fields_of(value, where, tuple(named))
        missing = [f for f in named if f not in given and f not in optional]
        unknown = [f for f in given if f not in named]
        if missing:
            raise BadRequestError("missing", f"{where} returned no {missing[0]!r}")
        if unknown:
            raise BadRequestError(
                "unknown_key", f"{where} returned {unknown[0]!r}", hint=did_you_mean(unknown[0], named)
            )
        return record(*(checks[f](given.get(f), f"{where}.{f}") for f in named))

    return check


def copy_containers(value: Any) -> Any:
    """`value` with its own lists and dicts, so that no two readers share one that can change."""
    kind = type(value)
    if kind is list:
        return [copy_containers(v) for v in value]
    if kind is dict:
        return {k: copy_containers(v) for k, v in value.items()}
    return value


def read_only(value: Any) -> Any:
    """`value` with every bare array in it read-only (copied first, so that its maker cannot change it either)."""
    kind = type(value)
    if kind is np.ndarray and value.flags.writeable:
        value = value.copy()
        value.flags.writeable = False
    elif kind is list:
        return [read_only(v) for v in value]
    elif kind is dict:
        return {k: read_only(v) for k, v in value.items()}
    return value


def require_finite(value: Any, where: str) -> None:
    """Raise `BadRequestError` where `value` holds a NaN or an infinity; depth images may (unknown distance)."""
    kind = type(value)
    if kind is float:
        finite = math.isfinite(value)
    elif kind is np.ndarray:
        finite = value.dtype.kind != "f" or bool(np.isfinite(value).all())
    elif kind is list or kind is tuple:
        for i, item in enumerate(value):
            require_finite(item, f"{where}[{i}]")
        return
    elif kind is dict:
        for key, item in value.items():
            require_finite(item, f"{where}.{key}")
        return
    elif isinstance(value, Value) and kind is not DepthImage:
        for name in _field_names(kind):  # type: ignore[arg-type]
            require_finite(getattr(value, name), f"{where}.{name}")
        return
    else:
        return
    if not finite:
        raise BadRequestError("not_finite", f"{where} is not finite")


@cache
def _field_names(cls: type) -> tuple[str, ...]:
    return tuple(f.name for f in fields(cls))


def _fields_of(value: Any, where: str, wanted: tuple[str, ...]) -> Mapping[str, Any]:
    if isinstance(value, Mapping):
        return value
    if hasattr(value, "_asdict"):
        return dict(value._asdict())
    if is_dataclass(value) and not isinstance(value, (type, Value)):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    raise BadRequestError("type", f"{where} returned {type(value).__name__}, not its fields {', '.join(wanted)}")


def _identifier(name: str) -> str:
    stem = "".join(c if c.isalnum() else "_" for c in name.rpartition("/")[2].removesuffix(".py"))
    return "".join(part[:1].upper() + part[1:] for part in stem.split("_")) + "Output"
