"""cuRobo behind the planning tools: its world, its robot, and paths taken only when our model finds them free too."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from gap_catalogue.shared import research_packages as published
from gap_catalogue.shared.robot_chain import chain
from gap_motion.bench.problems import free_space
from gap_motion.bench.verify import TrajectoryVerifier
from gap_motion.curobo import search as curobo_search
from gap_motion.planning.free_motion import timed
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planner import plan
from gap_robots.panda import panda
from gap_runtime.contracts.failures import PlanningError, ToolError
from tests.unit.hf import packages

PANDA = panda()
CHAIN = chain(PANDA)
T_LAST_HAND = np.eye(4)
T_LAST_HAND[:3, 3] = (0.0, 0.0, 0.107)


@pytest.fixture(autouse=True)
def _fresh():
    published.forget()
    yield
    published.forget()


@pytest.fixture(scope="module")
def hard():
    """A problem that needs a detour, and a path that is one."""
    problem = next(p for p in free_space(PANDA, 60, seed=3) if not MotionValidator(p.checker).free(p.start, p.goals[0]))
    return problem, plan(problem.checker, problem.start, problem.goals, 1).waypoints


@pytest.fixture
def curobo(monkeypatch):
    """Stand-ins of cuRobo 0.7's modules; `paths` are what it finds, one per request, None where it finds nothing."""

    def install(paths, turn=0.0, dof=7, spheres=()):
        seen = SimpleNamespace(worlds=[], requests=[], configured=[], warmed=[])

        def joints(q):
            return SimpleNamespace(position=q)

        class MotionGen:
            def __init__(self, config):
                self.tensor_args = SimpleNamespace(device=torch.device("cpu"))
                self.kinematics = SimpleNamespace(get_robot_as_spheres=self.arm)

            def arm(self, q):
                return [[SimpleNamespace(pose=[*center, 1, 0, 0, 0], radius=radius) for *center, radius in spheres]]

            def clear_world_cache(self):
                seen.worlds.clear()

            def warmup(self, warmup_js_trajopt=False):
                seen.warmed.append(warmup_js_trajopt)

            def get_retract_config(self):
                return torch.zeros(dof)

            def compute_kinematics(self, state):
                q = state.position.numpy().astype(float)
                T = CHAIN.frames(q + turn * q**2)[-1] @ T_LAST_HAND
                x, y, z, w = Rotation.from_matrix(T[:, :3, :3]).as_quat().T
                return SimpleNamespace(
                    ee_pos_seq=torch.as_tensor(T[:, :3, 3]), ee_quat_seq=torch.as_tensor(np.stack([w, x, y, z], axis=1))
                )

            def update_world(self, world):
                seen.worlds.append(world.cuboid)

            def plan_single_js(self, start_state, goal_state, plan_config):
                seen.requests.append((start_state.position.numpy(), goal_state.position.numpy(), plan_config))
                rows = paths[min(len(seen.requests), len(paths)) - 1]
                found = None if rows is None else joints(torch.as_tensor(np.asarray(rows), dtype=torch.float32))
                return SimpleNamespace(success=torch.tensor([rows is not None]), get_interpolated_plan=lambda: found)

        def load_from_robot_config(robot_cfg, world_model=None, *, collision_cache, interpolation_dt):
            seen.configured.append((robot_cfg, collision_cache))
            return None

        packages.install(
            monkeypatch,
            curobo__wrap__reacher__motion_gen={
                "MotionGenConfig": SimpleNamespace(load_from_robot_config=load_from_robot_config),
                "MotionGen": MotionGen,
                "MotionGenPlanConfig": SimpleNamespace,
            },
            curobo__geom__types={
                "Cuboid": lambda name, pose, dims: SimpleNamespace(name=name, pose=pose, dims=dims),
                "WorldConfig": lambda cuboid: SimpleNamespace(cuboid=cuboid),
            },
            curobo__types__robot={"JointState": SimpleNamespace(from_position=joints)},
        )
        return seen

    return install


def search(problem, goals=None, checker=None):
    return curobo_search.search(checker or problem.checker, problem.start, problem.goals if goals is None else goals, 0)


def dense(rows):
    return np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(rows)])


def test_its_path_is_taken_shortened_and_ends_where_asked(curobo, hard):
    problem, way = hard
    curobo([dense(way)])
    rows = search(problem)
    assert len(rows) <= len(way) and MotionValidator(problem.checker).path_free(rows)
    np.testing.assert_allclose(rows[0], problem.start)
    np.testing.assert_allclose(rows[-1], problem.goals[0])


def test_a_timed_motion_comes_of_it(curobo, hard):
    problem, way = hard
    curobo([dense(way)])
    path = plan(problem.checker, problem.start, problem.goals, search=curobo_search.search)
    trajectory = timed(problem.checker, path.waypoints)
    assert trajectory is not None and TrajectoryVerifier(PANDA, problem.shapes).judge(trajectory).clean
    np.testing.assert_allclose(trajectory.positions[[0, -1]], [problem.start, problem.goals[path.goal]], atol=1e-6)


def test_a_path_that_is_not_free_for_us_is_not_taken(curobo, hard):
    problem, way = hard
    straight = np.linspace(problem.start, problem.goals[0], 50)
    seen = curobo([straight, dense(way)])
    goals = np.concatenate([problem.goals[:1], problem.goals[:1]])
    assert len(search(problem, goals)) > 2 and len(seen.requests) == 2


def test_no_such_path_is_said(curobo, hard):
    problem, _ = hard
    curobo([np.linspace(problem.start, problem.goals[0], 50)])
    with pytest.raises(PlanningError, match="no path") as caught:
        search(problem)
    assert caught.value.code == "no_path"


def test_goals_are_tried_in_their_order_and_not_without_end(curobo, hard):
    problem, _ = hard
    seen = curobo([None])
    with pytest.raises(PlanningError):
        search(problem, np.repeat(problem.goals[:1], 9, axis=0))
    assert len(seen.requests) == curobo_search.GOALS
    start, goal, options = seen.requests[0]
    np.testing.assert_allclose(start[0], problem.start, atol=1e-6)
    np.testing.assert_allclose(goal[0], problem.goals[0], atol=1e-6)
    assert options.timeout == curobo_search.TIMEOUT_S


@pytest.mark.parametrize("k", [0, 1])
def test_its_world_is_ours_in_the_arms_base_frame(curobo, k):
    problem = free_space(PANDA, 2, seed=3)[k]  # a cage of spheres, then boxes on a floor
    seen = curobo([None])
    with pytest.raises(PlanningError):
        search(problem)
    scene, base = problem.checker.world, np.asarray(problem.checker.base)
    (boxes,) = seen.worlds
    assert len(boxes) == len(scene.names)
    for box, center, half in zip(boxes, scene.centers, scene.half + scene.rounding[:, None], strict=True):
        np.testing.assert_allclose(base[:3, :3] @ box.pose[:3] + base[:3, 3], center, atol=1e-9)
        np.testing.assert_allclose(box.dims, 2 * (half + problem.checker.margin), atol=1e-9)
        assert np.linalg.norm(box.pose[3:]) == pytest.approx(1)


def test_its_world_gives_way_where_its_arm_stands(curobo):
    problem = free_space(PANDA, 2, seed=3)[1]
    scene, base = problem.checker.world, np.asarray(problem.checker.base)
    touched = (scene.centers[0] - base[:3, 3]) @ base[:3, :3]
    seen = curobo([None], spheres=[(*touched, 0.01)])
    with pytest.raises(PlanningError):
        search(problem)
    for box in seen.worlds[0]:
        x, y, z, w = (*box.pose[4:], box.pose[3])
        local = Rotation.from_quat([x, y, z, w]).as_matrix().T @ (touched - box.pose[:3])
        assert np.linalg.norm(np.maximum(np.abs(local) - np.array(box.dims) / 2, 0.0)) > 0.01


def test_it_is_built_and_warmed_once_with_its_own_model_of_the_arm(curobo, hard, monkeypatch):
    problem, way = hard
    seen = curobo([dense(way)])
    search(problem), search(problem)
    assert [robot for robot, _ in seen.configured] == ["franka.yml"] and seen.warmed == [True]
    monkeypatch.setenv(curobo_search.ROBOT, "/cell/arm.yml")
    search(problem)
    assert seen.configured[-1][0] == "/cell/arm.yml"


@pytest.mark.parametrize("other", [{"turn": 0.01}, {"dof": 9}])
def test_another_arm_is_refused(curobo, hard, other):
    curobo([hard[1]], **other)
    with pytest.raises(ToolError, match="does not move as panda does") as caught:
        search(hard[0])
    assert caught.value.code == "unsupported"


def test_without_the_package_it_says_where_to_get_it(hard):
    with pytest.raises(ToolError, match="cuRobo cannot be imported") as caught:
        search(hard[0])
    assert caught.value.code == "extra" and "0.7" in (caught.value.hint or "")


def test_an_arm_without_a_configuration_needs_one(curobo, hard, monkeypatch):
    monkeypatch.setattr(curobo_search, "ROBOTS", {})
    curobo([hard[1]])
    with pytest.raises(ToolError, match="No configuration of cuRobo"):
        search(hard[0])
