"""One codec for every contract value: plain data for JSON and msgpack, and back, checked against a type.

Arrays of up to `INLINE` numbers are written as nested lists, so that files diff; larger ones as base64 with dtype and
shape. Decoding refuses unknown keys, wrong shapes and non-finite scalars.
"""

from __future__ import annotations

import base64
import math
import typing
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np

from gap_cli.contracts.failures import BadRequestError
from gap_cli.contracts.typeref import TypeRef
from gap_cli.contracts.types import CONTRACT_TYPES, Array

INLINE = 64
MAX_ARRAY_BYTES = 256_000_000


def to_plain(value: Any, *, digits: int | None = None) -> Any:
    """Plain data (dict, list, str, float, int, bool, None). With `digits`, floats are rounded, for canonical files."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if digits is None else _rounded(float(value), digits)
    if isinstance(value, np.ndarray):
        return _array_to_plain(value, digits)
    if is_dataclass(value) and not isinstance(value, type):
        given = ((f.name, getattr(value, f.name)) for f in fields(value))
        return {name: to_plain(v, digits=digits) for name, v in given if v is not None}
    if isinstance(value, Mapping):
        return {str(k): to_plain(v, digits=digits) for k, v in value.items()}
    if hasattr(value, "_asdict"):
        return to_plain(value._asdict(), digits=digits)
    if isinstance(value, (Sequence, set, frozenset)):
        items = sorted(value) if isinstance(value, (set, frozenset)) else value
        return [to_plain(v, digits=digits) for v in items]
    raise BadRequestError("type", f"a value of type {type(value).__name__} cannot be written to a file or the wire")


def from_plain(data: Any, type_: TypeRef | str, *, where: str = "value") -> Any:
    """The value of type `type_` that `data` describes. Raises `BadRequestError` naming the place and the problem."""
    ref = TypeRef.parse(type_) if isinstance(type_, str) else type_
    if data is None:
        if ref.optional or ref.name == "any":
            return None
        raise BadRequestError("missing", f"{where}: {ref} is missing")
    if ref.is_list:
        if not isinstance(data, Sequence) or isinstance(data, (str, bytes)):
            raise BadRequestError("type", f"{where}: expected a list of {ref.name}, got {type(data).__name__}")
        item = TypeRef(ref.name, ref.frame)
        return [from_plain(d, item, where=f"{where}[{i}]") for i, d in enumerate(data)]
    if ref.name == "any":
        return data
    cls = CONTRACT_TYPES.get(ref.name)
    if cls is not None:
        return data if isinstance(data, cls) else _object_from_plain(data, cls, where)
    return _scalar(data, ref.name, where)


def _object_from_plain(data: Any, cls: type, where: str) -> Any:
    if not isinstance(data, Mapping):
        raise BadRequestError("type", f"{where}: expected {cls.__name__}, got {type(data).__name__}")
    hints = _hints(cls)
    unknown = sorted(set(data) - set(hints))
    if unknown:
        raise BadRequestError(
            "unknown_key", f"{where}: {cls.__name__} has no field {unknown[0]!r}", hint=f"Fields: {', '.join(hints)}."
        )
    values: dict[str, Any] = {}
    for name, ref in hints.items():
        if name in data:
            values[name] = _field(data[name], ref, f"{where}.{name}")
    try:
        return cls(**values)
    except (TypeError, ValueError) as error:
        raise BadRequestError("shape", f"{where}: {error}") from None


def _field(data: Any, ref: TypeRef | None, where: str) -> Any:
    if ref is None:  # an array, whose shape the class checks itself
        return None if data is None else _array_from_plain(data, where)
    value = from_plain(data, ref, where=where)
    return tuple(value) if ref.is_list else value


@cache
def _hints(cls: type) -> dict[str, TypeRef | None]:
    """Field name to TypeRef; None marks an array field."""
    out: dict[str, TypeRef | None] = {}
    resolved = typing.get_type_hints(cls, include_extras=True)
    for f in fields(cls):
        try:
            out[f.name] = TypeRef.of(resolved[f.name])
        except TypeError:
            out[f.name] = None
    return out


def _scalar(data: Any, name: str, where: str) -> Any:
    if name == "float" and isinstance(data, (int, float, np.integer, np.floating)) and not isinstance(data, bool):
        if not math.isfinite(data):
            raise BadRequestError("not_finite", f"{where}: {data} is not a finite number")
        return float(data)
    if name == "int" and isinstance(data, (int, np.integer)) and not isinstance(data, bool):
        return int(data)
    if name == "bool" and isinstance(data, (bool, np.bool_)):
        return bool(data)
    if name == "string" and isinstance(data, str):
        return data
    raise BadRequestError("type", f"{where}: expected {name}, got {type(data).__name__}")


def _rounded(value: float, digits: int) -> float:
    return round(value, digits) + 0.0  # + 0.0 turns -0.0 into 0.0


def _array_to_plain(array: Array, digits: int | None) -> Any:
    if array.size <= INLINE and array.dtype != np.bool_:
        return to_plain(array.tolist(), digits=digits)
    if digits is not None and array.dtype.kind == "f":
        array = np.round(array, digits) + 0.0
    packed = np.packbits(array) if array.dtype == np.bool_ else np.ascontiguousarray(array)
    data = base64.b64encode(packed.tobytes()).decode("ascii")
    return {"dtype": array.dtype.str, "shape": list(array.shape), "base64": data}


def _array_from_plain(data: Any, where: str) -> Array:
    if isinstance(data, np.ndarray):
        return data
    if isinstance(data, list):
        try:
            return np.array(data, dtype=float) if data else np.zeros((0, 3))
        except (TypeError, ValueError):
            raise BadRequestError("shape", f"{where}: not a rectangular array of numbers") from None
    try:
        dtype, shape, raw = np.dtype(data["dtype"]), [int(n) for n in data["shape"]], data["base64"]
        if dtype.kind not in "biuf" or any(n < 0 for n in shape) or math.prod(shape) * dtype.itemsize > MAX_ARRAY_BYTES:
            raise ValueError(f"dtype {dtype} or shape {shape}")
        buffer = np.frombuffer(base64.b64decode(raw, validate=True), np.uint8)
        if dtype == np.bool_:
            return np.unpackbits(buffer, count=math.prod(shape)).astype(bool).reshape(shape)
        return np.frombuffer(buffer.tobytes(), dtype).reshape(shape)
    except (KeyError, TypeError, ValueError) as error:
        raise BadRequestError("shape", f"{where}: not an array ({error})") from None
