"""Variants lie over the document, and over each other where one extends another."""

from __future__ import annotations

import pytest
import yaml

from gap_runtime.contracts.failures import DocumentError, UnknownNameError
from gap_runtime.contracts.task import load_task

BASE = {
    "schema": "gap/task/v1",
    "name": "tiny",
    "description": "d",
    "instructions": ["do it"],
    "environment": {
        "supports": {"floor": {"z": 0.0, "half_size": [1, 1]}},
        "workspace": [[0, 0, 0], [1, 1, 1]],
    },
    "robots": [{"model": "panda"}],
    "objects": {"can": {"label": "can", "shape": {"kind": "box", "size": [0.1, 0.1, 0.1]}, "mass": 1.0}},
    "belief": {"regions": {"a": {"center": [0, 0], "support": "floor"}}},
    "scenes": {"can": {"can": "a"}},
    "success": {"there": 'w.body("{target}").x > 0.5'},
}


@pytest.fixture
def load(tmp_path):
    def load(variants, chosen=None):
        (tmp_path / "task.yaml").write_text(yaml.safe_dump({**BASE, "variants": variants}, sort_keys=False))
        return load_task(tmp_path, chosen)

    return load


FAST = {"max_time": 10.0, "belief": {"clearance": 0.02}}


def test_a_variant_extends_another(load):
    task = load({"plain": {}, "fast": FAST, "both": {"extends": "fast", "belief": {"attempts": 7}}}, "both")
    assert (task.variant, task.max_time) == ("both", 10.0)
    assert (task.belief.clearance, task.belief.attempts) == (0.02, 7)
    assert load({"plain": {}, "fast": FAST}).max_time == 120.0


def test_the_last_word_is_the_variants_own(load):
    variants = {
        "a": FAST,
        "b": {"extends": "a", "max_time": 20.0},
        "c": {"extends": "b", "belief": {"clearance": 0.03}},
    }
    task = load(variants, "c")
    assert (task.max_time, task.belief.clearance) == (20.0, 0.03)


@pytest.mark.parametrize(
    ("variants", "message"),
    [
        ({"a": {"extends": "a"}}, "variants.a.extends: goes in circles: a > a"),
        ({"a": {"extends": "b"}, "b": {"extends": "a"}}, "circles: a > b > a"),
        ({"a": {"extends": "fats"}, "fast": {}}, "'fats' is not a variant. Did you mean 'fast'"),
        ({"a": {"extends": ["b"]}, "b": {}}, "variants.a.extends"),
        ({"a": [1]}, "variants.a: must be a mapping"),
    ],
)
def test_what_cannot_be_extended_is_named(load, variants, message):
    with pytest.raises(DocumentError, match=message):
        load(variants)


def test_an_unknown_variant_is_named(load):
    with pytest.raises(UnknownNameError, match="'fsat'"):
        load({"fast": {}}, "fsat")
