"""One codec for every contract value: plain data for JSON, msgpack and protobuf, and back, checked against a type.

In text, arrays of up to `INLINE` finite numbers are nested lists, so that files diff; others base64 with dtype and
shape. In binary they stay arrays. Decoding refuses unknown keys, wrong shapes, lossy numbers and non-finite scalars.
"""

from __future__ import annotations

import base64
import math
import re
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import CONTRACT_TYPES, Array, Value
from gap_runtime.contracts.types.typeref import TypeRef

INLINE = 64
MAX_ARRAY_BYTES = 256_000_000
TYPE_KEY, RECORD_KEY = "$type", "$record"
_SURROGATE = re.compile("[\ud800-\udfff]")
_DTYPE = re.compile(r"[<>|=]?(b1|[iu][1248]|f[248])")


def to_plain(value: Any, *, digits: int | None = None) -> Any:
    """Plain data (dict, list, str, float, int, bool, None). With `digits`, floats are rounded, for canonical files.

    Raises `BadRequestError` for a value no file can hold.
    """
    try:
        return _plain(value, lambda array: _array_to_plain(array, digits), digits, tagged=False)
    except RecursionError:
        raise BadRequestError("type", "a value is nested too deeply to be written, or holds itself") from None


def to_raw(value: Any, *, tagged: bool = False) -> Any:
    """As `to_plain`, with arrays left as they are. `tagged` marks contract values and named results as such, so that
    they can be read back without knowing their type."""
    try:
        return _plain(value, lambda array: array, None, tagged=tagged)
    except RecursionError:
        raise BadRequestError("type", "a value is nested too deeply to be sent, or holds itself") from None


def _plain(value: Any, leaf: Callable[[Array], Any], digits: int | None, *, tagged: bool) -> Any:
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if digits is None else _rounded(float(value), digits)
    if isinstance(value, np.ndarray):
        return leaf(value)
    if is_dataclass(value) and not isinstance(value, type):
        given = ((f.name, getattr(value, f.name)) for f in fields(value))
        out = {name: _plain(v, leaf, digits, tagged=tagged) for name, v in given if v is not None}
        if not tagged:
            return out
        return {TYPE_KEY: type(value).__name__, **out} if isinstance(value, Value) else {RECORD_KEY: out}
    if isinstance(value, Mapping):
        return _mapping(value, leaf, digits, tagged=tagged)
    if hasattr(value, "_asdict"):
        out = {name: _plain(v, leaf, digits, tagged=tagged) for name, v in value._asdict().items()}
        return {RECORD_KEY: out} if tagged else out
    if isinstance(value, (Sequence, set, frozenset)) and not isinstance(value, (bytes, bytearray, memoryview)):
        return [_plain(v, leaf, digits, tagged=tagged) for v in _ordered(value)]
    raise BadRequestError("type", f"a value of type {type(value).__name__} cannot be written to a file or the wire")


def _mapping(value: Mapping[Any, Any], leaf: Callable[[Array], Any], digits: int | None, *, tagged: bool) -> Any:
    out = {str(k): _plain(v, leaf, digits, tagged=tagged) for k, v in value.items()}
    if len(out) != len(value):
        raise BadRequestError("type", "two keys of a mapping are the same text")
    if tagged and (TYPE_KEY in out or RECORD_KEY in out):
        raise BadRequestError("type", f"the keys {TYPE_KEY} and {RECORD_KEY} are reserved")
    return out


def _ordered(value: Any) -> Any:
    if not isinstance(value, (set, frozenset)):
        return value
    try:
        return sorted(value)
    except TypeError:
        raise BadRequestError("type", "a set whose members have no order cannot be written") from None


def from_plain(data: Any, type_: TypeRef | str, *, where: str = "value") -> Any:
    """The value of type `type_` that `data` describes. Raises `BadRequestError` naming the place and the problem."""
    ref = TypeRef.parse(type_) if isinstance(type_, str) else type_
    if data is None:
        if ref.optional or ref.name == "any":
            return None
        raise BadRequestError("missing", f"{where}: {ref} is missing")
    if ref.is_list:
        if isinstance(data, np.ndarray) and data.ndim == 1:
            data = data.tolist()
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
    hints = field_refs(cls)
    unknown = sorted(set(data) - set(hints), key=str)
    if unknown:
        raise BadRequestError(
            "unknown_key", f"{where}: {cls.__name__} has no field {unknown[0]!r}", hint=f"Fields: {', '.join(hints)}."
        )
    missing = sorted(_required(cls) - set(data))
    if missing:
        raise BadRequestError("missing", f"{where}: {cls.__name__} needs {missing[0]!r}")
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
def field_refs(cls: type) -> dict[str, TypeRef | None]:
    """Field name to TypeRef; None marks an array field."""
    out: dict[str, TypeRef | None] = {}
    resolved = typing.get_type_hints(cls, include_extras=True)
    for f in fields(cls):
        try:
            out[f.name] = TypeRef.of(resolved[f.name])
        except TypeError:
            out[f.name] = None
    return out


@cache
def _required(cls: type) -> frozenset[str]:
    return frozenset(f.name for f in fields(cls) if f.default is MISSING and f.default_factory is MISSING)


def _scalar(data: Any, name: str, where: str) -> Any:
    number = isinstance(data, (int, float, np.integer, np.floating)) and not isinstance(data, bool)
    if name == "float" and number:
        try:
            value = float(data)
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            raise BadRequestError("not_finite", f"{where}: {str(data)[:40]} is not a finite number")
        return value
    if name == "int" and number and isinstance(data, (int, np.integer)):
        if not -(2**63) <= int(data) < 2**63:
            raise BadRequestError("range", f"{where}: does not fit into 64 bits")
        return int(data)
    if name == "bool" and isinstance(data, (bool, np.bool_)):
        return bool(data)
    if name == "string" and isinstance(data, str):
        if not data.isascii() and _SURROGATE.search(data):
            raise BadRequestError("type", f"{where}: holds half of a surrogate pair")
        return data
    raise BadRequestError("type", f"{where}: expected {name}, got {type(data).__name__}")


def _rounded(value: float, digits: int) -> float:
    return round(value, digits) + 0.0  # + 0.0 turns -0.0 into 0.0


def _array_to_plain(array: Array, digits: int | None) -> Any:
    if array.dtype.kind not in "biuf":
        raise BadRequestError("type", f"an array of {array.dtype} cannot be written to a file or the wire")
    if digits is not None and array.dtype.kind == "f":
        array = np.round(array, digits) + 0.0
    if 0 < array.size <= INLINE and array.dtype != np.bool_ and bool(np.isfinite(array).all()):
        return array.tolist()
    packed = np.packbits(array) if array.dtype == np.bool_ else np.ascontiguousarray(array)
    data = base64.b64encode(packed.tobytes()).decode("ascii")
    return {"dtype": array.dtype.str, "shape": list(array.shape), "base64": data}


def _array_from_plain(data: Any, where: str) -> Array:
    if isinstance(data, np.ndarray):
        return data
    try:
        if isinstance(data, (list, tuple)):
            array = np.array(data if len(data) else np.zeros(0))
            if array.dtype.kind not in "biuf":
                raise ValueError("not all of it is numbers")
            return array
        dtype, shape = array_layout(data["dtype"], data["shape"])
        raw = np.frombuffer(base64.b64decode(data["base64"], validate=True), np.uint8)
        return array_of(dtype, shape, raw, packed=True)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BadRequestError("shape", f"{where}: not a rectangular array of numbers ({error})") from None


def array_layout(dtype: Any, shape: Any) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """A dtype and shape read from untrusted data. Raises ValueError where they are not those of a contract array."""
    if not isinstance(dtype, str) or not _DTYPE.fullmatch(dtype):
        raise ValueError(f"dtype {str(dtype)[:20]!r}")
    if not isinstance(shape, list) or len(shape) > 8 or not all(type(n) is int and 0 <= n < 2**40 for n in shape):
        raise ValueError("a bad shape")
    if math.prod(shape) * np.dtype(dtype).itemsize > MAX_ARRAY_BYTES:
        raise ValueError(f"larger than {MAX_ARRAY_BYTES // 1_000_000} MB")
    return np.dtype(dtype), tuple(shape)


def array_of(dtype: np.dtype[Any], shape: tuple[int, ...], raw: Array, *, packed: bool = False) -> Array:
    """The array whose bytes are `raw` (uint8); `packed`: eight booleans a byte. Raises ValueError on a wrong length."""
    count = math.prod(shape)
    bits = packed and dtype == np.bool_
    want = (count + 7) // 8 if bits else count * dtype.itemsize
    if raw.size != want:
        raise ValueError(f"{raw.size} bytes where shape {list(shape)} needs {want}")
    if bits:
        return np.unpackbits(raw, count=count).astype(bool).reshape(shape)
    if dtype == np.bool_ and raw.size and raw.max() > 1:
        raise ValueError("a boolean that is neither 0 nor 1")
    return raw.view(dtype).reshape(shape)
