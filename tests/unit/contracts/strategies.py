"""Hypothesis strategies for every contract type, edge values included."""

import typing
from dataclasses import fields

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.encoding.codec import field_refs
from gap_runtime.contracts.types import CONTRACT_TYPES, Quaternion, Trajectory

floats = st.floats(allow_nan=False, allow_infinity=False)
texts = st.text(st.characters(codec="utf-8"), max_size=8)
sides = st.integers(0, 9)
SCALARS = {
    "float": floats,
    "int": st.integers(-(2**63), 2**63 - 1),
    "bool": st.booleans(),
    "string": texts,
}


def arrays(dtype, *shape, nan=False):
    elements = None
    if np.dtype(dtype).kind == "f":
        width = np.dtype(dtype).itemsize * 8
        elements = st.floats(allow_nan=nan, allow_infinity=nan, width=width)
    sizes = st.tuples(*(sides if n is None else st.just(n) for n in shape))
    return sizes.flatmap(lambda size: hnp.arrays(dtype, size, elements=elements))


ARRAYS = {
    "Image.data": arrays("u1", None, None, 3),
    "DepthImage.data": arrays("f4", None, None, nan=True),
    "Mask.data": arrays("?", None, None),
    "PointCloud.points": arrays("f8", None, 3),
    "PointCloud.colors": arrays("u1", None, 3),
    "Matrix3x3.data": arrays("f8", 3, 3),
    "JointState.positions": arrays("f8", None),
    "JointState.velocities": arrays("f8", None),
    "JointState.efforts": arrays("f8", None),
    "ActionChunk.joints": arrays("f8", None, None),
    "ActionChunk.gripper": arrays("f8", None),
    "Obstacle.points": arrays("f8", None, 3),
    "Obstacle.triangles": arrays("i8", None, 3),
}


@st.composite
def trajectories(draw):
    steps, joints = draw(sides), draw(sides)
    rows = arrays("f8", steps, joints)
    return Trajectory(draw(arrays("f8", steps)), draw(rows), draw(st.none() | rows))


def field(cls, name, ref):
    if ref is None:
        value = ARRAYS[f"{cls.__name__}.{name}"]
        hint = typing.get_type_hints(cls)[name]
        return st.none() | value if type(None) in typing.get_args(hint) else value
    value = SCALARS[ref.name] if ref.name in SCALARS else values(ref.name)
    if ref.is_list:
        value = st.lists(value, max_size=3).map(tuple)
    return st.none() | value if ref.optional else value


def values(name):
    """Any value of the contract type called `name`."""
    cls = CONTRACT_TYPES[name]
    if cls is Quaternion:
        return st.tuples(*[st.floats(-10, 10)] * 3).map(lambda r: Quaternion.of(Rotation.from_rotvec(r)))
    if cls is Trajectory:
        return trajectories()
    assert [f.name for f in fields(cls)] == list(field_refs(cls))
    return st.builds(cls, **{n: field(cls, n, ref) for n, ref in field_refs(cls).items()})
