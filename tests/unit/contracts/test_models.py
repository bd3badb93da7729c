"""Every problem of a document is named at once, by the keys and the spelling that its author knows."""

from __future__ import annotations

import pytest
from pydantic import Field

from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.models import Document, ProblemsError


class Part(Document):
    size: float = Field(gt=0)
    kind: str = "box"


class Whole(Document):
    schema_: str = Field(alias="schema")
    parts: dict[str, Part] = {}
    pair: tuple[float, float] = (0, 0)
    use: str | dict[str, str] = ""


def problems(data):
    with pytest.raises(DocumentError) as refused:
        Whole.load(data, "whole.yaml")
    return refused.value.problems


def test_a_key_is_called_as_its_author_spells_it():
    assert problems({"schem": "x"}) == ("schem: is not a known key. Did you mean 'schema'?",)
    assert problems({"schema_": "x"}) == ("schema_: is not a known key. Did you mean 'schema'?",)
    assert problems({"schema": "x", "parts": {"a": {"size": 1, "knd": "b"}}}) == (
        "parts.a.knd: is not a known key. Did you mean 'kind'?",
    )


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        ({}, "schema: is missing"),
        ({"schema": "x", "parts": {"a": {"size": 0}}}, "parts.a.size: 0 should be greater than 0"),
        ({"schema": "x", "pair": [1.0]}, "pair.1: is missing"),
        ({"schema": "x", "pair": [1, 2, 3]}, "pair: Tuple should have at most 2 items, not 3"),
        ({"schema": "x", "use": 5}, "use: 5 should be a valid string or a valid dictionary"),
        ({"schema": "x" * 70, "parts": 5}, "parts: 5 should be a valid dictionary"),
        (None, "the document: None should be a valid dictionary or instance of Whole"),
    ],
)
def test_a_problem_has_its_key_its_value_and_its_bound(data, problem):
    assert problems(data) == (problem,)


def test_all_problems_are_told():
    found = problems({"parts": {"a": {"size": -1}, "b": {}}, "colour": 1})
    assert [p.partition(":")[0] for p in found] == ["colour", "schema", "parts.a.size", "parts.b.size"]
    with pytest.raises(DocumentError, match=r"^whole.yaml: 2 problems: schema: is missing; pair"):
        Whole.load({"pair": 3}, "whole.yaml")


def test_a_validator_may_name_several():
    class Strict(Whole):
        def model_post_init(self, context):
            ProblemsError.raise_any([("parts.a", "is too much"), ("", "is odd")])

    with pytest.raises(DocumentError) as refused:
        Strict.load({"schema": "x"}, "strict.yaml")
    assert refused.value.problems == ("parts.a: is too much", "the document: is odd")
