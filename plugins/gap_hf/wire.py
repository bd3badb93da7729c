"""numpy arrays in msgpack as the package msgpack-numpy writes them, read without its unpickling."""

from __future__ import annotations

import math
from typing import Any

import msgpack
import numpy as np


def packed(message: dict[str, Any]) -> bytes:
    """A message with arrays in it as bytes."""
    return bytes(msgpack.packb(message, use_bin_type=True, default=_encoded))


def unpacked(raw: bytes) -> Any:
    """What the bytes hold. Raises ValueError for anything but plain data and numeric arrays."""
    try:
        return msgpack.unpackb(raw, raw=False, strict_map_key=False, object_hook=_decoded)
    except (msgpack.UnpackException, UnicodeDecodeError, KeyError, TypeError) as problem:
        raise ValueError(f"not a msgpack message: {problem}") from None


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        shape = list(value.shape)
        return {b"nd": True, b"type": value.dtype.str, b"kind": b"", b"shape": shape, b"data": value.tobytes()}
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _decoded(value: dict[Any, Any]) -> Any:
    if b"nd" not in value:
        return value
    if value.get(b"kind", b"") not in (b"", None) or not isinstance(value[b"type"], str):
        raise ValueError("an array of objects")  # msgpack-numpy would unpickle it: code of the server's choosing
    dtype = np.dtype(value[b"type"])
    if dtype.kind not in "biuf":
        raise ValueError(f"an array of {dtype}")
    if not value[b"nd"]:
        return np.frombuffer(value[b"data"], dtype)[0].item()
    shape = tuple(value[b"shape"])
    if math.prod(shape) * dtype.itemsize != len(value[b"data"]):
        raise ValueError(f"an array of shape {shape} in {len(value[b'data'])} bytes")
    return np.frombuffer(value[b"data"], dtype).reshape(shape)
