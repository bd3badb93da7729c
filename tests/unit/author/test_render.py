"""Rendering: values as code, and templates that cannot do harm or fail in silence."""

from __future__ import annotations

import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gap_cli.author.render import literal, render_file
from gap_runtime.errors import DocumentError

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@given(plain)
def test_a_literal_reads_back_as_the_value(value):
    assert ast.literal_eval(literal(value)) == value


def test_words_are_in_double_quotes():
    assert literal({"a": ["b", 1]}) == '{"a": ["b", 1]}'


@pytest.mark.parametrize(
    ("template", "says"),
    [
        ("{{ nobody }}", "nobody"),
        ("line\n{% if %}", r":2: is not a template"),
        ("{{ ''.__class__.__mro__ }}", "cannot be rendered"),
        ("{{ 1 / 0 }}", "ZeroDivisionError"),
        ("{% include 'x' %}", "cannot be rendered"),
    ],
)
def test_a_template_that_cannot_be_rendered_is_one_error(tmp_path, template, says):
    file = tmp_path / "t.py.j2"
    file.write_text(template)
    with pytest.raises(DocumentError, match=says) as caught:
        render_file(file)
    assert caught.value.where.startswith(str(file))
