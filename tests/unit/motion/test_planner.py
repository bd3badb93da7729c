import numpy as np
import pytest

from gap_motion.bench.problems import cage, checker_among, free_space, groceries
from gap_motion.bench.verify import TrajectoryVerifier
from gap_motion.planning.free_motion import to_grasps, to_joints, to_poses
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planner import plan, shortcut
from gap_runtime.contracts.failures import PlanningError


@pytest.fixture(scope="module")
def hard():
    """A problem that needs a detour."""
    made = {}

    def of(spec):
        if spec.name not in made:
            made[spec.name] = next(
                p for p in free_space(spec, 60, seed=3) if not MotionValidator(p.checker).free(p.start, p.goals[0])
            )
        return made[spec.name]

    return of


def test_a_path_starts_at_the_start_ends_at_a_goal_and_is_free(spec, hard):
    problem = hard(spec)
    path = plan(problem.checker, problem.start, problem.goals, seed=1)
    np.testing.assert_allclose(path.waypoints[0], problem.start)
    np.testing.assert_allclose(path.waypoints[-1], problem.goals[path.goal])
    assert len(path.waypoints) > 2 and MotionValidator(problem.checker).path_free(path.waypoints)


def test_same_seed_same_path_another_seed_another(spec, hard):
    problem = hard(spec)
    paths = [plan(problem.checker, problem.start, problem.goals, seed).waypoints for seed in (5, 5, 6)]
    np.testing.assert_array_equal(paths[0], paths[1])
    assert paths[0].shape != paths[2].shape or not np.allclose(paths[0], paths[2])


def test_improving_shortens_the_paths(spec, hard):
    problem = hard(spec)

    def length(improve):
        paths = (plan(problem.checker, problem.start, problem.goals, seed, improve).waypoints for seed in (3, 4))
        return sum(np.linalg.norm(np.diff(rows, axis=0), axis=1).sum() for rows in paths)

    assert length(True) < 0.97 * length(False)


def test_the_nearest_of_several_goals_is_taken(spec, hard):
    problem = hard(spec)
    near = problem.start + 0.05
    goals = np.stack([problem.goals[0], near])
    assert plan(problem.checker, problem.start, goals).goal == 1


def test_the_cage_is_left_and_the_timed_motion_judged_clean(robot):
    spec = robot("panda")
    problem = cage(spec, np.random.default_rng(0))
    found = to_joints(problem.checker, problem.start, problem.goals, 0)
    assert TrajectoryVerifier(spec, problem.shapes).judge(found.trajectory).clean


@pytest.mark.parametrize("seed", range(3))
def test_timed_motions_are_judged_clean_by_another_checker(spec, seed):
    for problem in free_space(spec, 4, seed=seed + 20)[1:]:
        found = to_joints(problem.checker, problem.start, problem.goals, 0)
        verdict = TrajectoryVerifier(spec, problem.shapes).judge(found.trajectory)
        assert verdict.clean and verdict.step < 0.05, verdict


def test_a_near_goal_behind_something_is_preferred_to_a_far_one_in_plain_sight(spec, monkeypatch):
    home, turn = np.array(spec.home), np.eye(spec.dof)[0]
    near, far = home + 0.3 * turn, home + 1.8 * turn
    free = MotionValidator.free

    def with_something_between(self, a, b):
        return free(self, a, b) and not (np.allclose(a, home) and np.allclose(b, near))

    monkeypatch.setattr(MotionValidator, "free", with_something_between)
    found = plan(checker_among(spec, ()), home, np.stack([far, near]))
    assert found.goal == 1 and len(found.waypoints) > 2
    np.testing.assert_allclose(found.waypoints[-1], near)


def test_servos_follow_a_planned_motion_closely_and_inside_every_limit(spec):
    problem = free_space(spec, 2, seed=20)[1]
    found = to_joints(problem.checker, problem.start, problem.goals, 0)
    tracked = TrajectoryVerifier(spec, problem.shapes).follow(found.trajectory)
    assert not tracked.contacts and tracked.velocity <= 1.0 and tracked.torque <= 1.0
    assert tracked.lag < 2e-3 and tracked.rest_error < 1e-3


def test_grasps_are_reached_straight_and_touch_only_the_target(spec):
    problem = groceries(spec, 1, grasps=12)[0]
    found = to_grasps(problem.scene, problem.start, problem.grasps, 0.08, [problem.target], 0)
    cell = problem.scene.cell
    way = cell.tcp(found.trajectory.positions)
    end = way[-1]
    back = way[:, :3, 3] - end[:3, 3]
    last = np.flatnonzero(np.linalg.norm(back, axis=1) > 0.06)[-1]  # the straight stretch without its rounded corner
    assert np.linalg.norm(back[last:] - np.outer(back[last:] @ end[:3, 2], end[:3, 2]), axis=1).max() < 2e-3
    np.testing.assert_allclose(end, cell.base @ problem.grasps[found.pose] @ cell.chain.tcp, atol=1e-3)
    verdict = TrajectoryVerifier(spec, problem.shapes).judge(found.trajectory)
    assert all(problem.target in contact for contact in verdict.contacts)
    assert max(verdict.velocity, verdict.acceleration, verdict.jerk, verdict.tcp_speed) <= 1.0


def test_a_start_in_collision_names_the_pair(spec, hard):
    problem = hard(spec)
    rng = np.random.default_rng(0)
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    q = rng.uniform(low, high, (200, spec.dof))
    bad = q[~problem.checker.valid(q)][0]
    with pytest.raises(PlanningError) as error:
        plan(problem.checker, bad, problem.goals)
    assert error.value.code == "in_collision" and len(error.value.detail["pair"]) == 2


def test_shortcuts_keep_the_ends_and_shorten(spec, hard):
    problem = hard(spec)
    edges = MotionValidator(problem.checker)
    rows = plan(problem.checker, problem.start, problem.goals, 4).waypoints
    detour = np.concatenate([rows[:1], (rows[:1] + rows[1:2]) / 2, rows])
    short = shortcut(edges, detour, 0)
    np.testing.assert_array_equal(short[[0, -1]], rows[[0, -1]])
    lengths = [np.linalg.norm(np.diff(way, axis=0), axis=1).sum() for way in (short, rows, detour)]
    assert edges.path_free(short) and lengths[0] <= lengths[1] < lengths[2]


def test_poses_out_of_reach_are_told_from_poses_in_collision(spec):
    problem = groceries(spec, 1)[0]
    cell, scene = problem.scene.cell, problem.scene
    far = np.tile(np.eye(4), (1, 1, 1))
    far[0, :3, 3] = [3.0, 0.0, 0.3]
    with pytest.raises(PlanningError) as error:
        to_poses(scene, problem.start, cell.last_joint_frame(far), 0)
    assert error.value.code == "unreachable"
    buried = cell.tcp(problem.start).copy()
    buried[0, :3, 3] = [0.45, 0.0, -0.03]
    with pytest.raises(PlanningError) as error:
        to_poses(scene, problem.start, cell.last_joint_frame(buried), 0)
    assert error.value.code == "in_collision" and "shape_0" in error.value.detail["pair"]
