"""What every contract value has in common: equality element by element, and arrays that nobody can change."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


class Value:
    """Base of all contract types; equality compares arrays element-wise."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        # Copies and unpickled values are made anew, so that their arrays are read-only too.
        return type(self), tuple(getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return a is not None and b is not None and np.array_equal(a, b, equal_nan=True)
    return bool(a == b)


def frozen(value: ArrayLike, dtype: Any, shape: tuple[int | None, ...], what: str) -> Array:
    """`value` as a read-only array of `dtype` and `shape` (None: any length). Raises ValueError naming `what`."""
    array = np.asarray(value)
    if array.dtype != dtype:
        array = _cast(array, np.dtype(dtype), what)
    if array.size == 0 and array.ndim == 1 and len(shape) == 2:  # an empty list says nothing of its columns
        array = array.reshape(0, shape[1] or 0)
    if array.ndim != len(shape) or any(w is not None and w != h for w, h in zip(shape, array.shape, strict=False)):
        want = "x".join("N" if s is None else str(s) for s in shape)
        raise ValueError(f"{what} must have shape {want}, got {'x'.join(map(str, array.shape)) or 'a scalar'}")
    if array.flags.writeable:
        array = array.copy() if array.base is not None or array is value else array
        array.flags.writeable = False
    return array


def _cast(array: Array, dtype: np.dtype[Any], what: str) -> Array:
    """`array` as `dtype`, refusing what would change a number into another one."""
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{what} must be numbers, got {array.dtype}")
    with np.errstate(invalid="ignore", over="ignore"):
        cast = array.astype(dtype)
    exact = dtype.kind == "f" or (dtype.kind == "b" and array.dtype.kind in "iu")
    if not exact and not np.array_equal(cast, array):
        raise ValueError(f"{what} must be {dtype}; some values are not")
    return cast
