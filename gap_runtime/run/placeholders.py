"""Makes up values of any contract type, so that a graph can be run through without a cell."""

from __future__ import annotations

import typing
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from gap_runtime.contracts import types as t
from gap_runtime.contracts.encoding.codec import from_plain
from gap_runtime.contracts.types.typeref import TypeRef


class Placeholder:
    """Stands for a value of type `any`: whatever is read from it is again anything."""

    def __getattr__(self, name: str) -> Placeholder:
        if name.startswith("__"):
            raise AttributeError(name)
        return self

    def __getitem__(self, key: object) -> Placeholder:
        return self

    def __repr__(self) -> str:
        return "anything"


PLACEHOLDER = Placeholder()
_SCALARS: dict[str, Any] = {"float": 0.5, "int": 1, "bool": True, "string": "dry", "any": PLACEHOLDER}
_ARRAYS: dict[type, dict[str, Any]] = {
    t.Image: {"data": np.zeros((4, 6, 3), np.uint8)},
    t.DepthImage: {"data": np.ones((4, 6), np.float32)},
    t.Mask: {"data": np.ones((4, 6), bool)},
    t.PointCloud: {"points": np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.1]])},
    t.Matrix3x3: {"data": np.eye(3)},
    t.JointState: {"positions": np.zeros(7)},
    t.Trajectory: {"times": np.array([0.0, 1.0]), "positions": np.zeros((2, 7))},
}


def placeholder(ref: TypeRef) -> Any:
    """A plausible value of type `ref`: one item in a list, unit rotations, a few points."""
    value = _one(TypeRef(ref.name))
    return [value] if ref.is_list else value


@cache
def _one(ref: TypeRef) -> Any:
    if ref.name in _SCALARS:
        return _SCALARS[ref.name]
    cls = t.CONTRACT_TYPES[ref.name]
    if cls is t.Quaternion:
        return t.Quaternion(1.0, 0.0, 0.0, 0.0)
    given = dict(_ARRAYS.get(cls, {}))
    hints = typing.get_type_hints(cls, include_extras=True)
    for field in fields(cls):
        if field.name not in given and _is_required(field):
            value = placeholder(TypeRef.of(hints[field.name]))
            given[field.name] = tuple(value) if isinstance(value, list) else value
    return from_plain(cls(**given), ref)


def _is_required(field: Any) -> bool:
    from dataclasses import MISSING

    return field.default is MISSING and field.default_factory is MISSING
