import json
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from gap_runtime.contracts.encoding.codec import INLINE, from_plain, to_plain, to_raw
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import (
    DepthImage,
    Detection,
    Image,
    JointState,
    Mask,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
)

UNIT = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
BOX = {"x_min": 0.0, "y_min": 0.0, "x_max": 1.0, "y_max": 1.0}


class Pair(NamedTuple):
    first: float
    second: Vec3


@dataclass
class Report:
    ok: bool
    note: str | None = None


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        (np.float32(0.5), 0.5),
        (np.int8(3), 3),
        (np.bool_(True), True),
        (True, True),
        ((1, 2), [1, 2]),
        ({"b", "a"}, ["a", "b"]),
        ({1: "x"}, {"1": "x"}),
        (Pair(1.0, Vec3(1, 2, 3)), {"first": 1.0, "second": {"x": 1, "y": 2, "z": 3}}),
        (Report(True), {"ok": True}),
        (Vec3(1, 2, 3), {"x": 1, "y": 2, "z": 3}),
        (np.array([1.5, 2.5]), [1.5, 2.5]),
        (None, None),
    ],
)
def test_values_become_plain(value, plain):
    assert to_plain(value) == plain
    assert type(to_plain(value)) is type(plain)


@pytest.mark.parametrize(
    "value",
    [object(), b"x", bytearray(2), memoryview(b"x"), {1, "a"}, {1: 2, "1": 3}, np.array([object()]), np.array(["a"]),
     1j, Vec3],
)  # fmt: skip
def test_what_no_file_can_hold_is_refused(value):
    with pytest.raises(BadRequestError):
        to_plain(value)


def test_a_value_that_holds_itself_is_refused():
    loop = {}
    loop["me"] = loop
    with pytest.raises(BadRequestError, match="holds itself"):
        to_plain(loop)


def test_digits_round_scalars_and_arrays_alike_and_leave_no_minus_zero():
    assert json.dumps(to_plain([0.1 + 0.2, -1e-9, np.array([1 / 3, -1e-9])], digits=3)) == "[0.3, 0.0, [0.333, 0.0]]"


def test_short_arrays_are_lists_and_long_ones_base64():
    short, long = np.arange(INLINE) * 1.0, np.arange(INLINE + 1) * 1.0
    assert to_plain(short) == short.tolist()
    assert to_plain(long)["shape"] == [INLINE + 1]


def test_booleans_are_packed_eight_to_a_byte():
    assert len(to_plain(Mask(np.ones((16, 8))))["data"]["base64"]) == 24


@pytest.mark.parametrize(
    "value",
    [
        DepthImage([[np.nan, np.inf, 0]]),
        PointCloud(np.zeros((0, 3))),
        JointState([]),
        DepthImage(np.zeros((0, 4))),
        Image(np.zeros((3, 0, 3))),
        Mask(np.zeros((0, 0))),
    ],
    ids=str,
)
def test_empty_and_not_finite_arrays_are_strict_json_and_keep_their_shape(value):
    text = json.dumps(to_plain(value), allow_nan=False)
    read = from_plain(json.loads(text), type(value).__name__)
    assert read == value
    assert [v.shape for v in vars(read).values() if v is not None] == [
        v.shape for v in vars(value).values() if v is not None
    ]


@pytest.mark.parametrize(
    ("data", "type_", "value"),
    [
        (1, "float", 1.0),
        (np.float32(0.5), "float", 0.5),
        (np.int64(2), "int", 2),
        (True, "bool", True),
        (np.bool_(False), "bool", False),
        ("größe 😀", "string", "größe 😀"),
        ([1, 2], "float[]", [1.0, 2.0]),
        ((1, 2), "int[]", [1, 2]),
        (np.array([1.0, 2.0]), "float[]", [1.0, 2.0]),
        (None, "float?", None),
        (None, "any", None),
        ({"x": [1]}, "any", {"x": [1]}),
        ({"x": 1, "y": 2, "z": 3}, "Vec3", Vec3(1.0, 2.0, 3.0)),
        (Vec3(1, 2, 3), "Vec3", Vec3(1, 2, 3)),
        ({"points": []}, "PointCloud", PointCloud(np.zeros((0, 3)))),
    ],
)
def test_plain_data_becomes_a_value(data, type_, value):
    assert from_plain(data, type_) == value


@pytest.mark.parametrize(
    ("data", "type_", "said"),
    [
        (None, "float", "value: float is missing"),
        ("1", "float", "expected float, got str"),
        (True, "float", "expected float, got bool"),
        (True, "int", "expected int, got bool"),
        (1.0, "int", "expected int, got float"),
        (1, "bool", "expected bool, got int"),
        (1, "string", "expected string, got int"),
        (float("nan"), "float", "nan is not a finite number"),
        (float("-inf"), "float", "-inf is not a finite number"),
        (10**400, "float", "not a finite number"),
        (2**63, "int", "64 bits"),
        ("\ud800", "string", "surrogate"),
        ("abc", "string[]", "expected a list of string, got str"),
        ({"a": 1}, "float[]", "expected a list"),
        ([1, "x"], "float[]", r"value\[1\]: expected float, got str"),
        ([None], "float[]", r"value\[0\]: float is missing"),
        ([], "Vec3", "expected Vec3, got list"),
        ({"x": 1, "y": 2}, "Vec3", "Vec3 needs 'z'"),
        ({"x": 1, "y": 2, "z": 3, "w": 4}, "Vec3", "Vec3 has no field 'w'"),
        ({1: 2}, "Vec3", "Vec3 has no field 1"),
        ({"x": 1, "y": 2, "z": None}, "Vec3", "value.z: float is missing"),
        ({"position": {"x": 1, "y": "2", "z": 3}, "rotation": UNIT}, "Se3Pose", "value.position.y: expected float"),
        ({"w": 2.0, "x": 0.0, "y": 0.0, "z": 0.0}, "Quaternion", "unit norm"),
        ({"box": BOX, "label": 7, "score": 0.5}, "Detection", "value.label: expected string"),
        ({"data": [[0.5]]}, "Mask", "must be bool"),
        ({"points": [[1, 2], [3]]}, "PointCloud", "rectangular"),
        ({"points": [["1", "2", "3"]]}, "PointCloud", "not all of it is numbers"),
        ({"points": [[1, 2]]}, "PointCloud", "shape Nx3"),
        ({"points": 3}, "PointCloud", "rectangular"),
        ({"points": None}, "PointCloud", "must be numbers"),
    ],
    ids=str,
)
def test_what_is_wrong_is_said_with_its_place(data, type_, said):
    with pytest.raises(BadRequestError, match=said):
        from_plain(data, type_)


@pytest.mark.parametrize(
    "array",
    [
        {},
        {"dtype": "<f8", "shape": [1, 3]},
        {"dtype": "|O", "shape": [1, 3], "base64": "AAAA"},
        {"dtype": "<f8,<f4", "shape": [1, 3], "base64": "AAAA"},
        {"dtype": "<U4", "shape": [1, 3], "base64": "AAAA"},
        {"dtype": ["f8"], "shape": [1, 3], "base64": "AAAA"},
        {"dtype": "<f8", "shape": 3, "base64": "AAAA"},
        {"dtype": "<f8", "shape": [-1, 3], "base64": "AAAA"},
        {"dtype": "<f8", "shape": [True, 3], "base64": "AAAA"},
        {"dtype": "<f8", "shape": [1.0, 3], "base64": "AAAA"},
        {"dtype": "<f8", "shape": [10**9, 3], "base64": "AAAA"},
        {"dtype": "<f8", "shape": [10**30, 0], "base64": ""},
        {"dtype": "<f8", "shape": [1] * 40, "base64": "AAAA"},
        {"dtype": "<f8", "shape": [1, 3], "base64": "AAAA"},
        {"dtype": "<f8", "shape": [1, 3], "base64": "A" * 10_000},
        {"dtype": "<f8", "shape": [0, 3], "base64": "!"},
        {"dtype": "<f8", "shape": [0, 3], "base64": 7},
        {"dtype": "|b1", "shape": [8, 3], "base64": "AA=="},
    ],
    ids=str,
)
def test_an_array_that_is_none_is_refused(array):
    with pytest.raises(BadRequestError):
        from_plain({"points": array}, "PointCloud")


def test_an_optional_array_may_be_absent_or_null():
    cloud = PointCloud([[1, 2, 3]])
    assert "colors" not in to_plain(cloud)
    assert from_plain({"points": [[1, 2, 3]], "colors": None}, "PointCloud") == cloud


def test_raw_keeps_arrays_and_tags_say_what_things_are():
    pose = Se3Pose(Vec3(1, 2, 3), Quaternion(1, 0, 0, 0))
    points = np.zeros((1, 3))
    assert to_raw([points])[0] is points
    assert to_raw(pose, tagged=True)["$type"] == "Se3Pose"
    assert to_raw(pose, tagged=True)["position"]["$type"] == "Vec3"
    assert to_raw(Pair(1.0, Vec3(1, 2, 3)), tagged=True)["$record"]["first"] == 1.0
    with pytest.raises(BadRequestError, match="reserved"):
        to_raw({"$type": "x"}, tagged=True)


def test_decoding_nested_types_is_complete():
    plain = to_plain(Detection(from_plain(BOX, "BoundingBox2D"), "soup", 0.5))
    assert from_plain(plain, "Detection").box.x_max == 1.0
