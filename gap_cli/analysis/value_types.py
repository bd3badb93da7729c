"""What a reference or a literal is, type by type: the types of data on their way through a graph."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import lru_cache
from typing import Any

from gap_cli.analysis.catalog import Signature
from gap_runtime.contracts import tool
from gap_runtime.contracts.encoding.codec import from_plain
from gap_runtime.contracts.failures import BadRequestError, did_you_mean
from gap_runtime.contracts.skill import Parameter
from gap_runtime.contracts.types import CONTRACT_TYPES
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.references import has_reference, is_reference

field_types = lru_cache(maxsize=256)(tool.field_types)
ANY = TypeRef("any")


@dataclass(frozen=True)
class StaticType:
    """What a value is: one of a contract type, or (`type` None) a bundle of named results that must be walked into.

    `choices` are the words it may be, where known; `unit` its unit, where its name or its parameter says so.
    """

    type: TypeRef | None
    fields: Mapping[str, TypeRef] = field(default_factory=dict)
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    unit: str = ""

    @property
    def words(self) -> tuple[str, ...]:
        """The words this value may be; empty when not known."""
        return self.choices.get("", ())


class NoSuchFieldError(Exception):
    """A walk into a value that ends: the message and the hint of a finding."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


def output_type(callee: Signature) -> StaticType | None:
    """What a node that calls this gives; None where it gives nothing."""
    if callee.output is not None:
        return StaticType(callee.output, choices=callee.choices)
    return StaticType(None, callee.fields, callee.choices) if callee.fields else None


def walk_type(value: StaticType, path: tuple[str, ...], what: str) -> StaticType:
    """The type found by following `path`. Raises `NoSuchFieldError`."""
    for name in path:
        value = _step(value, name, what)
        what = f"{what}.{name}"
    return value


def _step(value: StaticType, name: str, what: str) -> StaticType:
    unit = unit_of(name)
    if value.type is None:
        if name not in value.fields:
            raise NoSuchFieldError(f"{what} has no {name!r}", did_you_mean(name, value.fields))
        words = value.choices.get(name)
        return StaticType(value.fields[name], choices={"": words} if words else {}, unit=unit)
    kind = value.type
    if kind.is_list:
        if not name.isdigit():
            message = f"{what} is a list of {kind.name} and has no {name!r}"
            raise NoSuchFieldError(message, f"Pick one, counted from the front: {what}.0, {what}.1, ...")
        return StaticType(replace(kind, is_list=False))
    if kind.name == "any":
        return StaticType(ANY, unit=unit)
    known = field_types(kind)
    if name not in known:
        hint = did_you_mean(name, known) if known else f"It is a {kind}; refer to {what} itself."
        raise NoSuchFieldError(f"{what} is a {kind} and has no {name!r}", hint)
    found = known[name]
    return StaticType(replace(found, optional=found.optional or kind.optional), unit=unit)


def parameter_type(parameter: Parameter) -> StaticType:
    """What `param.<name>` is."""
    words = {"": tuple(parameter.choices)} if parameter.choices else {}
    return StaticType(TypeRef(parameter.type), choices=words, unit=parameter.unit)


_UNITS = {"m": "m", "mm": "mm", "cm": "cm", "s": "s", "ms": "ms", "deg": "deg", "rad": "rad", "hz": "Hz", "kg": "kg"}


def unit_of(name: str) -> str:
    """The unit a name ends in (`timeout_s`, `yaw_deg`), or ''."""
    return _UNITS.get(name.rpartition("_")[2], "") if "_" in name else ""


@dataclass(frozen=True)
class InputSlot:
    """One piece of data in an input: where it is, what must be there, and the data: a reference or a literal.

    `problem` says what is wrong with a mapping or list around it, which then has no value of its own.
    """

    path: str
    type: TypeRef
    value: Any
    unit: str = ""
    problem: str = ""


def input_slots(value: Any, type_: TypeRef, path: str, unit: str = "") -> Iterator[InputSlot]:
    """Split data into references and literals, each with the type its place asks for."""
    if is_reference(value) or not has_reference(value):
        yield InputSlot(path, type_, value, unit)
    elif isinstance(value, list):
        item = replace(type_, is_list=False, optional=False) if type_.is_list else ANY
        if not type_.is_list and type_.name != "any":
            yield InputSlot(path, type_, value, problem="is a list")
        for i, part in enumerate(value):
            yield from input_slots(part, item, f"{path}.{i}")
    else:
        known = {} if type_.is_list else field_types(type_)
        if type_.name != "any":
            yield from (InputSlot(path, type_, value, problem=p) for p in _misfits(value, type_, known))
        for name, part in value.items():
            yield from input_slots(part, known.get(name, ANY), f"{path}.{name}", unit_of(name))


def _misfits(value: Mapping[str, Any], type_: TypeRef, known: Mapping[str, TypeRef]) -> Iterator[str]:
    """What keeps a mapping with references inside from being one of a contract type."""
    if not known:
        yield "is a mapping"
        return
    yield from (f"has no field {name!r}" for name in value if name not in known)
    needed = (f.name for f in fields(CONTRACT_TYPES[type_.name]) if f.default is MISSING)
    yield from (f"field {name!r} is missing" for name in needed if name not in value)


def literal_problem(value: Any, type_: TypeRef) -> tuple[str, str] | None:
    """Why a literal does not fit (message, hint), or None."""
    try:
        from_plain(value, type_, where="it")
    except BadRequestError as error:
        return error.message.removeprefix("it: ").removeprefix("it"), error.hint
    return None
