"""One value, three encodings: JSON, msgpack and protobuf give the same value back, and bad bytes a typed error."""

import contextlib
import json
from typing import NamedTuple

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gap_runtime.contracts.encoding.codec import from_plain, to_plain
from gap_runtime.contracts.encoding.framing import from_msgpack, pack, to_msgpack, unpack
from gap_runtime.contracts.encoding.protobuf import from_proto, message_class, proto_text, to_proto
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import CONTRACT_TYPES, PointCloud, Vec3
from tests.unit.contracts.strategies import texts, values

NAMES = list(CONTRACT_TYPES)
anything = st.sampled_from(NAMES).flatmap(lambda name: st.tuples(st.just(name), values(name)))
numbers = st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
keys = texts.filter(lambda key: "$" not in key)
plain = st.recursive(
    st.none() | st.booleans() | numbers | texts,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_a_value_is_the_same_by_json_msgpack_and_protobuf(name, data):
    value = data.draw(values(name))
    text = json.dumps(to_plain(value), allow_nan=False)
    assert from_plain(json.loads(text), name) == value
    assert from_msgpack(to_msgpack(value), name) == value
    assert from_proto(to_proto(value), name) == value
    assert unpack(pack(value)) == value


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=5, deadline=None)
@given(data=st.data())
def test_arrays_keep_their_type_and_cannot_be_written_to(name, data):
    value = data.draw(values(name))
    for read in (from_msgpack(to_msgpack(value), name), from_proto(to_proto(value), name), unpack(pack(value))):
        for key, item in vars(value).items():
            if isinstance(item, np.ndarray):
                got = getattr(read, key)
                assert got.dtype == item.dtype
                assert got.shape == item.shape
                assert not got.flags.writeable


@settings(deadline=None)
@given(st.lists(values("Grasp"), max_size=3))
def test_a_list_travels_as_a_list(grasps):
    assert from_msgpack(to_msgpack(grasps), "Grasp[]") == grasps


@settings(deadline=None)
@given(plain)
def test_plain_data_describes_itself(tree):
    assert unpack(pack(tree)) == tree


@settings(deadline=None)
@given(anything, plain)
def test_contract_values_inside_plain_data_stay_whole(pair, tree):
    mixed = {"value": pair[1], "rest": [tree, pair[1]]}
    assert unpack(pack(mixed)) == mixed


class Found(NamedTuple):
    score: float
    where: Vec3


def test_a_named_result_comes_back_as_the_reader_likes():
    sent = pack([Found(0.5, Vec3(1, 2, 3))])
    assert unpack(sent) == [{"score": 0.5, "where": Vec3(1, 2, 3)}]
    assert unpack(sent, record=lambda f: Found(**f)) == [Found(0.5, Vec3(1, 2, 3))]


HOSTILE = {
    "nothing": b"",
    "not msgpack": b"\xc1",
    "cut short": pack({"a": [1, 2, 3]})[:-1],
    "two messages": pack(1) + pack(2),
    "a list of four billion": b"\xdd\xff\xff\xff\xff",
    "a map of four billion": b"\xdf\xff\xff\xff\xff",
    "a string of four billion": b"\xdb\xff\xff\xff\xff",
    "nested": b"\x91" * 100 + b"\x01",
    "nested deeper than the C stack": b"\x91" * 100_000,
    "more items than anyone needs": msgpack.packb([[[]] * 60_000] * 40),
    "infinity": msgpack.packb([float("inf")]),
    "bytes": msgpack.packb(b"x"),
    "a time": msgpack.packb(msgpack.Timestamp(1)),
    "keys that are no text": msgpack.packb({1: 2}),
    "bytes as keys": msgpack.packb({b"a": 2}),
    "a key twice": b"\x82\xa1a\x01\xa1a\x02",
    "text that is not UTF-8": b"\xa2\xed\xa0",
    "an unknown extension": msgpack.packb(msgpack.ExtType(9, b"x")),
    "an array without a header": msgpack.packb(msgpack.ExtType(1, b"")),
    "an array of objects": msgpack.packb(msgpack.ExtType(1, b"\x05\x92\xa2|O\x91\x01" + bytes(8))),
    "an array with too few bytes": msgpack.packb(msgpack.ExtType(1, b"\x07\x92\xa3<f8\x91\x02" + bytes(8))),
    "an array with a negative side": msgpack.packb(msgpack.ExtType(1, b"\x07\x92\xa3<f8\x91\xff")),
    "a boolean that is seven": msgpack.packb(msgpack.ExtType(1, b"\x07\x92\xa3|b1\x91\x01\x07")),
    "an unknown type": msgpack.packb({"$type": "os.system"}),
    "a type that is a list": msgpack.packb({"$type": ["Vec3"]}),
    "a type with a field missing": msgpack.packb({"$type": "Vec3", "x": 1.0}),
    "a type with a field too many": msgpack.packb({"$type": "Vec3", "x": 1.0, "y": 1.0, "z": 1.0, "w": 1.0}),
    "a rotation that is none": msgpack.packb({"$type": "Quaternion", "w": 2.0, "x": 0.0, "y": 0.0, "z": 0.0}),
    "a record that is a list": msgpack.packb({"$record": []}),
    "a record with more": msgpack.packb({"$record": {}, "x": 1}),
    "a record with a field that is no name": msgpack.packb({"$record": {"a b": 1}}),
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_hostile_msgpack_is_one_typed_error(data):
    with pytest.raises(BadRequestError):
        unpack(data)


@settings(deadline=None)
@given(anything, st.integers(0, 10**6), st.integers(1, 255))
def test_one_changed_byte_gives_a_value_or_a_typed_error(pair, place, change):
    name, value = pair
    for encode, decode in ((pack, unpack), (to_proto, lambda data: from_proto(data, name))):
        data = bytearray(encode(value))
        if data:
            data[place % len(data)] ^= change
            with contextlib.suppress(BadRequestError):
                decode(bytes(data))


@settings(deadline=None)
@given(st.binary(max_size=200), st.sampled_from(NAMES))
def test_any_bytes_give_a_value_or_a_typed_error(data, name):
    for decode in (unpack, lambda d: from_msgpack(d, name), lambda d: from_proto(d, name)):
        with contextlib.suppress(BadRequestError):
            decode(data)


@pytest.mark.parametrize(
    "value",
    [object(), b"bytes", {"$type": 1}, {"$record": 1}, 2**64, "\ud800", float("nan"), np.array([object()]), {1, "a"}],
)
def test_what_cannot_travel_is_refused_before_it_leaves_or_when_it_arrives(value):
    with pytest.raises(BadRequestError):
        unpack(pack(value))


def test_a_value_that_holds_itself_is_refused():
    loop = []
    loop.append(loop)
    with pytest.raises(BadRequestError, match="nested"):
        pack(loop)


def test_fields_of_a_newer_protocol_are_refused_rather_than_dropped():
    newer = message_class("BoundingBox2D")(y_max=1.0).SerializeToString()
    with pytest.raises(BadRequestError, match="do not know"):
        from_proto(newer, "Vec3")


def test_a_message_without_what_its_type_needs_is_refused():
    with pytest.raises(BadRequestError, match="position"):
        from_proto(b"", "Se3Pose")


def test_only_contract_types_have_a_message():
    with pytest.raises(BadRequestError, match="PointClod"):
        message_class("PointClod")
    with pytest.raises(BadRequestError):
        to_proto([Vec3(0, 0, 0)])


def test_the_proto_file_names_every_type_and_field_with_its_number():
    text = proto_text()
    for name in NAMES:
        body = text.split(f"message {name} {{\n")[1].split("}")[0]
        for field in message_class(name).DESCRIPTOR.fields:
            assert f" {field.name} = {field.number};" in body
    assert "optional Array" not in text
    assert "  Se3Pose pose = 5;  // in the world frame" in text
    assert "repeated CameraObservation cameras = 1;" in text


def test_a_cloud_without_points_keeps_its_columns():
    cloud = PointCloud(np.zeros((0, 3)))
    assert from_proto(to_proto(cloud), "PointCloud").points.shape == (0, 3)
    assert from_plain({"points": []}, "PointCloud").points.shape == (0, 3)
