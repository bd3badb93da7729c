"""Values at the border of a node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import DepthImage, PointCloud, Trajectory, Vec3
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.values import copy_containers, make_check, make_result_check, read_only, require_finite


def result_check(**fields):
    return make_result_check("scripts/x/look_up.py", None, {k: TypeRef.parse(v) for k, v in fields.items()})


def test_a_value_of_the_type_passes_unchanged_and_plain_data_is_decoded():
    check = make_check(TypeRef("Vec3"))
    v = Vec3(1.0, 2.0, 3.0)
    assert check(v, "x") is v
    assert check({"x": 1, "y": 2, "z": 3}, "x") == v


@pytest.mark.parametrize(
    "type_, value",
    [("Vec3", 3), ("float", "3"), ("int", 3.5), ("bool", 1), ("string", 3), ("Mask[]", 1), ("float", None)],
)
def test_a_value_of_another_type_is_refused_with_its_place(type_, value):
    with pytest.raises(BadRequestError, match=r"node\.x"):
        make_check(TypeRef.parse(type_))(value, "node.x")


def test_numpy_scalars_are_numbers():
    assert make_check(TypeRef("float"))(np.float32(0.5), "x") == 0.5
    assert make_check(TypeRef("int"))(np.int64(3), "x") == 3


class Pair(NamedTuple):
    found: bool
    score: float


@pytest.mark.parametrize("returned", [{"found": True, "score": 1}, Pair(True, 1.0)])
def test_named_results_become_one_kind_of_record(returned):
    record = result_check(found="bool", score="float")(returned, "n")
    assert record.found is True and record.score == 1.0
    assert type(record).__name__ == "LookUpOutput"


@pytest.mark.parametrize(
    "returned, says",
    [({"found": True}, "no 'score'"), ({"found": True, "score": 1, "more": 2}, "'more'"), (True, "found, score")],
)
def test_missing_extra_or_bare_results_are_refused(returned, says):
    with pytest.raises(BadRequestError, match=says):
        result_check(found="bool", score="float")(returned, "n")


def test_optional_fields_may_be_left_out():
    assert result_check(found="bool", mask="Mask?")({"found": False}, "n").mask is None


def test_a_result_that_was_not_promised_is_dropped():
    assert make_result_check("t", None, {})({"secret": 1}, "n") is None


@pytest.mark.parametrize(
    "bad", [float("nan"), [1.0, float("inf")], {"a": np.array([np.nan])}, PointCloud(np.full((1, 3), np.inf))]
)
def test_what_is_not_finite_is_refused(bad):
    with pytest.raises(BadRequestError, match="not finite"):
        require_finite(bad, "x")


def test_a_trajectory_with_one_nan_is_refused_by_field():
    with pytest.raises(BadRequestError, match=r"x\.positions"):
        require_finite(Trajectory(np.array([0.0]), np.array([[np.nan]])), "x")


def test_depth_may_hold_unknown_distances():
    require_finite(DepthImage(np.full((2, 2), np.nan, np.float32)), "x")


def test_readers_get_containers_of_their_own():
    value = {"a": [1, 2]}
    mine = copy_containers(value)
    mine["a"].append(3)
    assert value == {"a": [1, 2]}


def test_sealing_copies_arrays_so_that_their_maker_cannot_change_them():
    array = np.zeros(3)
    kept = read_only([array])[0]
    array[0] = 1
    assert kept[0] == 0
    with pytest.raises(ValueError):
        kept[0] = 1
