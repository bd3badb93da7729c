"""The real VAMP, where it is installed: its kinematics are ours, its paths are free, and a seed gives one path."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_catalogue.shared.robot_chain import chain
from gap_motion.bench.problems import cage, free_space
from gap_motion.collision.primitives import Box, PrimitiveScene
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planner import plan
from gap_motion.vamp.arm import installed, library, vamp_arm
from gap_motion.vamp.scene import environment
from gap_motion.vamp.search import VampSearch
from tests.unit.motion import vamp_like
from tests.unit.motion.conftest import REGISTRY, random_joints

pytestmark = pytest.mark.skipif(not installed(), reason="vamp-planner is not installed")
PANDA = REGISTRY.robot("panda")


@pytest.fixture(scope="module")
def hard():
    """Problems that need a detour."""
    return [p for p in free_space(PANDA, 25, seed=3) if not MotionValidator(p.checker).free(p.start, p.goals[0])][:8]


def test_its_panda_is_ours_to_the_micrometre():
    arm, ours = vamp_arm(chain(PANDA)), chain(PANDA)
    q = random_joints(PANDA, 50)
    theirs = np.array([arm.module.eefk(row.tolist()) for row in q])
    np.testing.assert_allclose(theirs, ours.poses(q, arm.tip), atol=1e-6)
    assert 0 < arm.fixed.sum() < len(arm.fixed)


def test_it_reads_a_scene_as_its_stand_in_of_these_tests_does():
    arm = vamp_arm(chain(PANDA))
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
    boxes = [Box(np.array([0.4, 0.2, 0.5]), turn, np.array([0.2, 0.15, 0.05]))]
    scene = PrimitiveScene(boxes, np.array([[-0.3, 0.2, 0.7, 0.1]]))
    theirs, ours = (environment(scene, module, 0.01) for module in (library(), vamp_like))
    alone = library().Environment()
    q = [row for row in random_joints(PANDA, 400) if arm.module.validate(row.tolist(), alone)]
    touched = [ours.touches(arm.spheres(row)) for row in q]
    assert 20 < sum(touched) < len(q) - 20
    assert touched == [not arm.module.validate(row.tolist(), theirs) for row in q]


def test_detours_are_free_and_repeat(hard):
    assert len(hard) > 3
    for problem in hard:
        rows = [plan(problem.checker, problem.start, problem.goals, 5, search=VampSearch()).waypoints for _ in range(2)]
        np.testing.assert_array_equal(rows[0], rows[1])
        np.testing.assert_array_equal(rows[0][[0, -1]], [problem.start, problem.goals[0]])
        assert MotionValidator(problem.checker).path_free(rows[0])


def test_another_seed_gives_another_path(hard):
    found = [plan(p.checker, p.start, p.goals, s, search=VampSearch()).waypoints for p in hard for s in (1, 2)]
    pairs = zip(found[::2], found[1::2], strict=True)
    assert any(a.shape != b.shape or not np.allclose(a, b) for a, b in pairs)


def test_the_cage_is_left_and_improving_costs_a_tenth_of_the_length_at_most():
    problem = cage(PANDA, np.random.default_rng(0))
    lengths = []
    for improve in (False, True):
        rows = plan(problem.checker, problem.start, problem.goals, search=VampSearch(improve=improve)).waypoints
        lengths.append(np.linalg.norm(np.diff(rows, axis=0), axis=1).sum())
    assert lengths[1] <= 1.1 * lengths[0]
