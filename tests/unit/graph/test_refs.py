"""References: what they name, and how they walk."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Vec3
from gap_runtime.graph.references import Reference, references_in, walk


@pytest.mark.parametrize(
    "text, source, name, fields",
    [
        ("observe", "node", "observe", ()),
        ("observe.cameras.0.rgb", "node", "observe", ("cameras", "0", "rgb")),
        ("in.target_obb", "in", "target_obb", ()),
        ("param.speed", "param", "speed", ()),
        ("inside.x", "node", "inside", ("x",)),
    ],
)
def test_each_form_is_read_and_written_back(text, source, name, fields):
    reference = Reference.parse(text)
    assert (reference.source, reference.name, reference.fields) == (source, name, fields)
    assert str(reference) == text


@pytest.mark.parametrize("text", ["", ".", "a..b", "in", "param", "in.", None, 3])
def test_malformed_text_is_refused(text):
    with pytest.raises(ValueError):
        Reference.parse(text)


def test_references_are_found_at_any_depth():
    data = {"a": {"$ref": "x"}, "b": [{"c": {"$ref": "in.y"}}, 3]}
    assert [(path, str(r)) for path, r in references_in(data, "inputs")] == [
        ("inputs.a", "x"),
        ("inputs.b.0.c", "in.y"),
    ]


def test_walking_reads_keys_attributes_and_items():
    assert walk({"a": [Vec3(1, 2, 3)]}, ("a", "0", "y"), "here") == 2


@pytest.mark.parametrize(
    "value, field", [({"a": 1}, "b"), ([1], "4"), (Vec3(0, 0, 0), "w"), (3, "x"), (Vec3(0, 0, 0), "__class__")]
)
def test_a_walk_that_ends_says_where(value, field):
    with pytest.raises(BadRequestError, match="here") as caught:
        walk(value, (field,), "here")
    assert repr(field) in str(caught.value)
