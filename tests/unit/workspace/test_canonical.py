import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gap_cli.workspace.canonical import json_line, json_text, jsonl_text, write_json, yaml_text
from gap_runtime.contracts.documents import parse_json, parse_yaml
from gap_runtime.contracts.types import Vec3

scalars = st.none() | st.booleans() | st.integers(-(10**6), 10**6) | st.text(st.characters(codec="utf-8"), max_size=12)
printable = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=30)
trees = st.recursive(scalars, lambda t: st.lists(t, max_size=4) | st.dictionaries(printable, t, max_size=4))


@given(trees)
def test_json_reads_back_as_it_was(tree):
    assert json.loads(json_text(tree)) == tree


@given(st.dictionaries(printable, printable, max_size=5))
def test_yaml_reads_back_strictly_as_it_was(mapping):
    assert parse_yaml(yaml_text(mapping), "test") == mapping


@pytest.mark.parametrize("word", ["no", "yes", "on", "y", "N", "12:30:45", "2024-01-01", "1e5", "null", "~", " x ", ""])
def test_yaml_keeps_words_words(word):
    assert parse_yaml(yaml_text({"a": word}), "test") == {"a": word}


def test_the_schema_comes_first_and_other_keys_keep_their_order():
    assert list(json.loads(json_text({"b": 1, "schema": "s/v1", "a": 2}))) == ["schema", "b", "a"]


def test_floats_are_rounded_and_minus_zero_is_zero():
    assert json_text([0.1 + 0.2, -0.0, -1e-9]) == "[0.3, 0.0, 0.0]\n"


def test_values_of_contracts_and_numpy_are_written():
    assert json_line({"p": Vec3(1.0, 2.0, 3.0), "n": np.int64(3), "a": np.zeros(2)}) == (
        '{"p": {"x": 1.0, "y": 2.0, "z": 3.0}, "n": 3, "a": [0.0, 0.0]}'
    )


def test_not_a_number_is_refused():
    with pytest.raises(ValueError):
        json_text({"a": float("nan")})


def test_short_collections_stay_on_one_line_and_long_ones_do_not():
    text = json_text({"short": [1, 2, 3], "long": ["x" * 40] * 4})
    assert '"short": [1, 2, 3]' in text
    assert text.count("\n") == 9


def test_rows_are_lines():
    rows = [{"seed": 1}, {"seed": 2}]
    lines = jsonl_text(rows).splitlines()
    assert [parse_json(line, "row") for line in lines] == rows


def test_writing_says_whether_bytes_changed(tmp_path):
    assert write_json(tmp_path / "a.json", {"a": 1})
    assert not write_json(tmp_path / "a.json", {"a": 1})
    assert write_json(tmp_path / "a.json", {"a": 2})
