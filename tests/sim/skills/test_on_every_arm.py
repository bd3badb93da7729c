"""Every skill that grasps and every way to carry, on every kind of arm: in physics, from what the cameras see."""

from __future__ import annotations

import numpy as np
import pytest

from gap_robots import arms
from tests.sim.skills.grocery import CARRIES, GRASPS, Cell

pytestmark = pytest.mark.sim
VARIANTS = {"panda": "object", "ur5e": "ur5e"}
JOBS = [*((grasp, CARRIES[0]) for grasp in GRASPS), *((GRASPS[0], mode) for mode in CARRIES[1:])]


@pytest.fixture(scope="module", params=VARIANTS)
def cell(request):
    made = Cell(VARIANTS[request.param])
    assert [arm.spec.name for arm in made.cell.arms] == [request.param]
    yield made
    made.cell.close()


@pytest.mark.parametrize(("grasp", "mode"), JOBS)
def test_the_milk_is_grasped_and_ends_in_the_basket(cell, grasp, mode, tmp_path):
    broken, success = cell.run(grasp, mode, tmp_path)
    assert broken == [] and success


def test_one_arm_does_the_job_while_another_stands_by(tmp_path):
    cell = Cell("two-arms")
    try:
        broken, success = cell.run(GRASPS[0], "collision_aware", tmp_path)
        assert broken == [] and success
        for arm in cell.cell.arms:
            np.testing.assert_allclose(arm.state().joints.positions, arm.spec.home, atol=0.01)
    finally:
        cell.cell.close()


def test_nothing_that_should_be_tried_is_missing():
    assert {"grasp-curobo-obb", "grasp-short-axis", "grasp-direct-ik"} <= set(GRASPS)
    assert set(CARRIES) == {"free_space", "collision_aware"}
    assert set(VARIANTS) == {spec.name for spec in arms()}
