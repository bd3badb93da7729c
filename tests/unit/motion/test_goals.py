"""Goal configurations, cheapest first."""

from dataclasses import replace

import numpy as np
import pytest

from gap_motion.bench.problems import groceries
from gap_motion.kinematics.ik import cost
from gap_motion.planning.goals import KEEP, cheapest_free, free_goals, within_limits
from gap_motion.planning.moves import pregrasp_pose


@pytest.fixture
def problem(spec):
    """Twelve grasps, as seen from 10 cm before them."""
    found = groceries(spec, 1, grasps=12)[0]
    return replace(found, grasps=pregrasp_pose(found.scene.cell, found.grasps, 0.1))


def test_they_come_cheapest_first_free_and_at_their_pose(spec, problem):
    checker, chain = problem.scene.checker(), problem.scene.cell.chain
    found = list(cheapest_free(checker, problem.grasps, problem.start))
    q, owner = np.array([q for q, _ in found]), np.array([pose for _, pose in found])
    assert len(q) and checker.valid(q).all()
    np.testing.assert_allclose(chain.poses(q, np.eye(4)), problem.grasps[owner], atol=1e-6)
    price = cost(chain, q, problem.start)
    assert (np.diff(price) >= 0).all()
    assert np.bincount(owner).max() <= KEEP


def test_the_same_poses_have_one_as_when_each_is_looked_at_alone(spec, problem):
    checker, chain = problem.scene.checker(), problem.scene.cell.chain
    rows = free_goals(checker, within_limits(chain, problem.grasps, problem.start))
    lazily = {pose for _, pose in cheapest_free(checker, problem.grasps, problem.start)}
    assert lazily == {i for i, q in enumerate(rows) if len(q)}


def test_little_is_checked_for_the_first_one(spec, problem):
    checker = problem.scene.checker()
    few = next(cheapest_free(checker, problem.grasps, problem.start))
    asked = checker.checked
    rest = list(cheapest_free(checker, problem.grasps, problem.start))
    assert few[1] == rest[0][1] and asked < checker.checked - asked


def test_poses_out_of_reach_have_none(spec, problem):
    far = problem.grasps.copy()
    far[:, :3, 3] += 5.0
    assert list(cheapest_free(problem.scene.checker(), far, problem.start)) == []
