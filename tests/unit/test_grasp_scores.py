"""What a grasp's score says: measures under a misplaced hand, their calibration, and how a ranking is judged."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_catalogue.shared.hand import Hand, above, clear_of, nearby
from gap_grasps import tools
from gap_grasps.calibration import FILE, Calibration, fitted
from gap_grasps.fit import chance, logistic
from gap_grasps.pose_error import DECLARED, PoseError, spread
from gap_grasps.reliability import auc, bins, ranking
from gap_grasps.robustness import Measures, misplacement_robustness
from gap_grasps.surface import Surface
from gap_robots.panda import panda
from gap_robots.ur5e import ur5e
from gap_runtime.contracts.types import PointCloud, Quaternion, Se3Pose, Vec3

DOWN = Rotation.from_euler("x", 180, degrees=True).as_matrix()
ROBOTS = pytest.mark.parametrize("spec", [panda(), ur5e()], ids=["panda", "ur5e"])


def block(size, bottom=0.0, spacing=0.003):
    """A box's surface, standing on z = bottom."""
    half = np.array(size) / 2
    axes = [np.arange(-h + spacing / 2, h, spacing) for h in half]
    points, normals = [], []
    for axis in range(3):
        grid = np.stack([g.ravel() for g in np.meshgrid(*(a for i, a in enumerate(axes) if i != axis))], axis=1)
        for sign in (-1, 1):
            points.append(np.insert(grid, axis, sign * half[axis], axis=1))
            normals.append(np.tile(sign * np.eye(3)[axis], (len(grid), 1)))
    points = np.concatenate(points) + np.array([0, 0, half[2] + bottom])
    return Surface(points, np.concatenate(normals), np.zeros(len(points), dtype=bool))


def pose(x=0.0, y=0.0, z=0.04, turn=DOWN):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, (x, y, z)
    return T


def measured(surface, *poses, spec, floor=0.0):
    return misplacement_robustness(surface, np.array(poses), Hand.of(spec), floor)


@ROBOTS
def test_a_good_grasp_has_good_measures(spec):
    found = measured(block((0.04, 0.04, 0.06)), pose(z=0.04), spec=spec)
    assert min(found.support[0], found.closure[0], found.purchase[0], found.leverage[0]) > 0.85


@ROBOTS
def test_each_measure_falls_with_what_it_measures(spec):
    small, wide = block((0.03, 0.03, 0.06)), block((0.03, spec.gripper.max_width - 0.004, 0.06))
    high, low = pose(z=0.045), pose(z=0.011)
    assert measured(small, high, low, spec=spec).support[1] < measured(small, high, low, spec=spec).support[0]
    assert measured(wide, high, spec=spec).fingers < measured(small, high, spec=spec).fingers
    deep = pose(z=0.06 - spec.gripper.finger_depth)
    assert measured(small, deep, spec=spec).palm <= measured(small, high, spec=spec).palm
    aslant = pose(turn=Rotation.from_euler("z", 45, degrees=True).as_matrix() @ DOWN)
    assert measured(small, aslant, spec=spec).closure < 0.3 < measured(small, high, spec=spec).closure
    tip = pose(z=0.06 + spec.gripper.finger_size[2] * 0.8)
    assert measured(small, tip, spec=spec).purchase < measured(small, high, spec=spec).purchase
    long = block((0.20, 0.03, 0.03))
    assert measured(long, pose(x=0.09), spec=spec).leverage < measured(long, pose(), spec=spec).leverage


@ROBOTS
def test_a_robots_own_jaws_decide_what_fits(spec):
    width = spec.gripper.max_width
    context = SimpleNamespace(
        seed=0, robot=lambda arm_id=0: spec,
        task=SimpleNamespace(environment=SimpleNamespace(
            supports={"floor": SimpleNamespace(z=0.0, center=(0.0, 0.0), half_size=(1.0, 1.0))})),
    )  # fmt: skip
    fits, not_so = (PointCloud(block((0.15, width + d, 0.06)).points) for d in (-0.02, 0.01))
    found = tools.plan_from_point_cloud(context, target_cloud=fits)
    assert found.grasp_poses and tools.plan_from_point_cloud(context, target_cloud=not_so).grasp_poses == []
    surface = block((0.15, width - 0.02, 0.06))
    T = np.array([p.matrix for p in found.grasp_poses])
    hand = Hand.of(spec)
    assert clear_of(surface.points, T, hand).all() and above(0.0, T, hand).all()


def test_a_grasp_of_nothing_scores_zero():
    surface = block((0.04, 0.04, 0.06))
    empty = measured(surface, pose(x=0.3), spec=panda())
    assert empty.closure[0] == 0 and fitted().chance(empty)[0] == 0


def test_without_a_support_nothing_can_meet_it():
    assert measured(block((0.04, 0.04, 0.06)), pose(z=0.001), spec=panda(), floor=None).support[0] == 1


def test_obstacles_count_for_the_hand_but_are_not_held():
    surface = block((0.03, 0.03, 0.06))
    beside = block((0.06, 0.03, 0.06)).points + np.array([0, 0.055, 0])
    args = np.array([pose()]), Hand.of(panda()), 0.0
    free, met = misplacement_robustness(surface, *args), misplacement_robustness(surface, *args, obstacles=beside)
    assert met.fingers < free.fingers and met.closure == free.closure and met.purchase == free.purchase


def test_the_spread_stands_for_the_error():
    offsets, turns = spread(DECLARED, 64)
    np.testing.assert_allclose(offsets.std(axis=0), DECLARED.position, rtol=0.1)
    angles = Rotation.from_matrix(turns).as_rotvec(degrees=True)
    np.testing.assert_allclose(angles.std(axis=0), DECLARED.rotation_deg, rtol=0.1)
    assert spread(DECLARED)[0] is spread(DECLARED)[0] and not spread(DECLARED)[0].flags.writeable


def test_drawn_errors_are_of_the_declared_size_and_of_the_seed():
    start = Se3Pose(Vec3(0.1, 0.2, 0.3), Quaternion(1, 0, 0, 0))
    rng = np.random.default_rng(0)
    missed = np.array([DECLARED.drawn(start, rng).position.array for _ in range(300)]) - start.position.array
    np.testing.assert_allclose(missed.std(axis=0), DECLARED.position, rtol=0.15)
    assert DECLARED.drawn(start, np.random.default_rng(3)) == DECLARED.drawn(start, np.random.default_rng(3))
    assert PoseError(0.0, 0.0).drawn(start, rng) == start


def test_nearby_finds_what_a_box_in_each_frame_holds(monkeypatch):
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (200, 3))
    T = np.tile(np.eye(4), (7, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = Rotation.random(7, rng=rng).as_matrix(), rng.uniform(-0.3, 0.3, (7, 3))
    low, high = np.array([-0.3, -0.4, -0.5]), np.array([0.5, 0.4, 0.3])
    local = np.stack([(points - t[:3, 3]) @ t[:3, :3] for t in T])
    expected = np.argwhere(((local >= low) & (local <= high)).all(axis=2))
    for elements in (10**6, 300):
        monkeypatch.setattr("gap_catalogue.shared.hand.ELEMENTS", elements)
        near = nearby(points, T, low, high)
        np.testing.assert_array_equal(np.column_stack([near.pose, near.point]), expected)
        np.testing.assert_allclose(near.local, local[tuple(expected.T)], atol=1e-6)
    assert len(nearby(points, T[:0], low, high).pose) == 0


def test_a_better_measure_never_lowers_a_score():
    data = json.loads(FILE.read_text())
    assert min(data["weights"].values()) >= 0 and set(data["weights"]) == set(Measures._fields)
    assert data["seeds"][1] < 10_000 and data["error"]["position_m"] == DECLARED.position
    assert data["error"]["rotation_deg"] == DECLARED.rotation_deg, "fit again: gap bench grasp-calibration"
    low, high = (Measures(*np.full((6, 1), v)) for v in (0.5, 0.9))
    assert 0 < fitted().chance(low)[0] < fitted().chance(high)[0] < 1


def test_the_fit_finds_the_map_that_made_the_data():
    rng = np.random.default_rng(0)
    x = rng.uniform(0, 1, (4000, 2))
    true = np.array([-2.0, 5.0, 0.0])
    fit = logistic(x, rng.random(len(x)) < chance(true, x))
    np.testing.assert_allclose(fit, true, atol=0.5)
    assert (fit[1:] >= 0).all() and (logistic(x, rng.random(len(x)) < 1 - x[:, 0])[1:] >= 0).all()
    weights = dict.fromkeys(Measures._fields, 0.0) | {"support": fit[1], "fingers": fit[2]}
    measures = Measures(*x.T, *np.ones((4, len(x))))
    np.testing.assert_allclose(Calibration(fit[0], weights).chance(measures), chance(fit, x))


def rows(scores, won):
    return [
        {"object": "x", "seed": i, "score": s, "success": w} for i, (s, w) in enumerate(zip(scores, won, strict=True))
    ]


def test_a_ranking_is_judged_by_how_it_parts_successes_from_failures():
    assert auc(np.array([0.1, 0.2, 0.8, 0.9]), np.array([False, False, True, True])) == 1
    assert auc(np.array([0.5, 0.5]), np.array([False, True])) == 0.5
    rng = np.random.default_rng(0)
    scores = rng.random(400)
    good, useless = (ranking(rows(scores, w)) for w in (rng.random(400) < scores, rng.random(400) < 0.5))
    assert good.interval[0] > 0.5 and good.p < 0.001 and good.calibration_error < 0.1
    assert useless.interval[0] < 0.5 < useless.interval[1]
    assert np.isnan(ranking(rows([0.1, 0.9], [True, True])).auc)


def test_bins_count_each_grasp_once_and_say_whether_the_score_holds():
    found = bins(rows([0.05, 0.95, 1.0], [True, True, True]))
    assert [(b.low, b.n) for b in found] == [(0.0, 1), (0.9, 2)]
    assert not found[0].agrees and found[1].agrees
