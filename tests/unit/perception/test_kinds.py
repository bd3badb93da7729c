"""Every shape a task may declare has words people use for it."""

from __future__ import annotations

from typing import get_args

from gap_perception.language.vocabulary import KIND_WORDS
from gap_runtime.contracts.task import Shape


def test_every_kind_of_shape_has_words():
    assert set(KIND_WORDS) == set(get_args(Shape.model_fields["kind"].annotation))
