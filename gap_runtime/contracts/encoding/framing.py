"""Contract values as msgpack: for a type both sides know, or self-describing; arrays travel as their raw bytes.

Decoding trusts no byte: sizes, depth, number of items, types and finiteness are checked before a value exists.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import msgpack
import numpy as np

from gap_runtime.contracts.encoding.codec import RECORD_KEY, TYPE_KEY, array_layout, array_of, from_plain, to_raw
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import CONTRACT_TYPES, Array, Value
from gap_runtime.contracts.types.typeref import TypeRef

ARRAY_EXT = 1
MAX_ITEMS = 1_000_000
MAX_LIST = 1 << 16
MAX_DEPTH = 32
Record = Callable[[dict[str, Any]], Any]


def to_msgpack(value: Any) -> bytes:
    """Bytes from which `from_msgpack` reads the value, given its type. Raises `BadRequestError`."""
    return _pack(to_raw(value))


def from_msgpack(data: bytes | bytearray, type_: TypeRef | str) -> Any:
    """The value of type `type_` in `data`. Raises `BadRequestError` for anything else."""
    return from_plain(_unpack(data, None), type_)


def pack(value: Any) -> bytes:
    """Bytes that say themselves what they hold, for `unpack`. Raises `BadRequestError`."""
    return _pack(to_raw(value, tagged=True))


def unpack(data: bytes | bytearray, *, record: Record = dict) -> Any:
    """What `pack` was given: contract values whole, sequences as lists, named results (NamedTuples and dataclasses of
    tools) through `record`. Raises `BadRequestError`."""
    return _unpack(data, record)


def _pack(tree: Any) -> bytes:
    try:
        packed: bytes = msgpack.packb(tree, default=_array_ext, strict_types=True)
    except (OverflowError, ValueError, TypeError, UnicodeEncodeError) as error:
        raise BadRequestError("type", f"a value cannot be sent: {error}") from None
    return packed


def _array_ext(value: Any) -> msgpack.ExtType:
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "biuf":
        raise TypeError(f"no place on the wire for {type(value).__name__}")
    little = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
    header: bytes = msgpack.packb([value.dtype.newbyteorder("<").str, list(value.shape)])
    return msgpack.ExtType(ARRAY_EXT, bytes([len(header)]) + header + little.tobytes())


def _array(code: int, data: bytes) -> Array:
    if code != ARRAY_EXT or not data:
        raise ValueError(f"unknown extension {code}")
    start = 1 + data[0]
    dtype, shape = array_layout(*msgpack.unpackb(data[1:start], max_array_len=16))
    return array_of(dtype, shape, np.frombuffer(data, np.uint8, offset=min(start, len(data))))


class _Budget:
    """Counts what the decoder builds, so that a small message cannot become a large tree."""

    def __init__(self, record: Record | None) -> None:
        self.record = record
        self.left = MAX_ITEMS

    def spend(self, count: int) -> None:
        self.left -= count + 1
        if self.left < 0:
            raise ValueError(f"more than {MAX_ITEMS} items")

    def of_list(self, items: list[Any]) -> list[Any]:
        self.spend(len(items))
        return items

    def of_map(self, pairs: list[tuple[Any, Any]]) -> Any:
        self.spend(2 * len(pairs))
        out = dict(pairs)
        if len(out) != len(pairs) or not all(type(key) is str for key in out):
            raise ValueError("keys of a mapping must be text, each once")
        if self.record is None:
            return out
        if TYPE_KEY in out:
            name = out.pop(TYPE_KEY)
            if not isinstance(name, str) or name not in CONTRACT_TYPES:
                raise ValueError("unknown contract type")
            return from_plain(out, TypeRef(name), where=name)
        if RECORD_KEY in out:
            fields = out.pop(RECORD_KEY)
            if out or not isinstance(fields, Mapping) or not all(k.isidentifier() for k in fields):
                raise ValueError("a malformed record")
            return self.record(dict(fields))
        return out


def _unpack(data: bytes | bytearray, record: Record | None) -> Any:
    budget = _Budget(record)
    try:
        tree = msgpack.unpackb(
            data, raw=False, ext_hook=_array, list_hook=budget.of_list, object_pairs_hook=budget.of_map,
            max_array_len=MAX_LIST, max_map_len=MAX_LIST, max_bin_len=0,
        )  # fmt: skip
        _check(tree)
    except BadRequestError:
        raise
    except (ValueError, TypeError, RecursionError, OverflowError, msgpack.UnpackException) as error:
        text = str(error) or type(error).__name__
        raise BadRequestError("wire", f"not a message of ours: {text[:200]}") from None
    return tree


def _check(tree: Any) -> None:
    """Refuse depth, foreign types and non-finite numbers outside contract values, which checked themselves."""
    layer, depth = [tree], 0
    while layer:
        depth += 1
        if depth > MAX_DEPTH:
            raise ValueError(f"nested deeper than {MAX_DEPTH}")
        below: list[Any] = []
        for item in layer:
            kind = type(item)
            if kind is list:
                below.extend(item)
            elif kind is dict:
                below.extend(item.values())
            elif kind is float:
                if not math.isfinite(item):
                    raise ValueError("a number that is not finite")
            elif item is None or kind in (str, int, bool, np.ndarray) or isinstance(item, (Value, tuple)):
                continue
            else:
                raise ValueError(f"no place for {kind.__name__}")
        layer = below
