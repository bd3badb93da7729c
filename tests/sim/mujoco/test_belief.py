"""Sampling: the same seed the same instance, objects clear of each other and in reach, or a reason why not."""

from __future__ import annotations

import re
from itertools import combinations

import cv2
import numpy as np
import pytest

from gap_mujoco.belief import Belief, as_variation
from gap_mujoco.model.footprint import clearance, footprint
from gap_runtime.contracts.failures import TaskInfeasibleError, UnknownNameError
from gap_runtime.contracts.task import Distribution, Shape, load_task

pytestmark = pytest.mark.sim
BOX = Shape(kind="box", size=(0.08, 0.04, 0.02))
CAN = Shape(kind="cylinder", size=(0.06, 0.06, 0.08))


def with_belief(task, **changes):
    return task.model_copy(update={"belief": task.belief.model_copy(update=changes)})


def moved(task, region, **changes):
    regions = {**task.belief.regions, region: task.belief.regions[region].model_copy(update=changes)}
    return with_belief(task, regions=regions)


def yaw_of(pose):
    return pose.rotation.rotation.as_euler("xyz")[2]


def outline(shape, pose):
    """The footprint's boundary as many points, made without the code under test, shape (N, 2)."""
    x, y = np.array(shape.size[:2]) / 2
    if shape.kind == "cylinder":
        t = np.linspace(0, 2 * np.pi, 200)
        return pose.position.array[:2] + x * np.column_stack([np.cos(t), np.sin(t)])
    t = np.linspace(-1, 1, 50)[:, None]
    sides = np.concatenate([t * (x, 0) + (0, s * y) for s in (-1, 1)] + [t * (0, y) + (s * x, 0) for s in (-1, 1)])
    return pose.rotation.rotation.apply(np.column_stack([sides, 0 * sides[:, 0]]))[:, :2] + pose.position.array[:2]


@pytest.mark.parametrize("variant", ["object", "xy20"])
def test_sampled_objects_stand_clear_in_their_regions_and_in_reach(task, robots, variant):
    task = load_task(task.path, variant)
    base, reach = np.array(task.robots[0].position[:2]), robots["panda"].reach
    for scene in task.scenes:
        belief = Belief(task, scene, robots)
        for seed in range(3):
            poses = belief.sample(seed).poses
            lines = {name: outline(task.objects[name].shape, pose) for name, pose in poses.items()}
            for a, b in combinations(poses, 2):
                apart = np.linalg.norm(lines[a][:, None] - lines[b][None], axis=-1).min()
                assert apart > task.belief.clearance - 2e-4, (scene, seed, a, b)
            for name, pose in poses.items():
                region = task.belief.regions[task.scenes[scene][name]]
                xy = pose.position.array[:2]
                assert (np.abs(xy - region.center) <= np.array(region.offset.uniform[1]) + 1e-12).all()
                assert np.linalg.norm(xy - base) <= reach
                assert pose.position.z == pytest.approx(task.objects[name].shape.size[2] / 2)


def test_a_seed_is_an_instance(task, robots):
    belief, again = Belief(task, "milk", robots), Belief(task, "milk", robots)
    assert belief.sample(7) == again.sample(7)
    assert belief.sample(7) != belief.sample(8)
    assert Belief(task, "butter", robots).sample(7).poses["butter"] != belief.sample(7).poses["butter"]


def test_order_of_sampling_does_not_matter(task, robots):
    belief = Belief(task, "milk", robots)
    forward = [belief.sample(seed) for seed in range(3)]
    assert [belief.sample(seed) for seed in (2, 1, 0)] == forward[::-1]


def test_a_crowded_region_is_named_with_what_it_cannot_hold(task, robots):
    crowded = moved(task, "slot_b", center=task.belief.regions["slot_a"].center)
    with pytest.raises(TaskInfeasibleError) as error:
        Belief(with_belief(crowded, attempts=20), "milk", robots).sample(0)
    assert "milk in region slot_a is clear of cream_cheese in region slot_b" in error.value.message
    assert re.search(r"0\.01 m, in \d+ of 100 draws", error.value.message)
    assert "20 draws" in error.value.message and "belief.attempts" in error.value.hint


def test_a_region_out_of_reach_says_so(task, robots):
    far = moved(task, "slot_a", center=(0.6, 0.6))
    with pytest.raises(
        TaskInfeasibleError,
        match=r"milk in region slot_a is within reach of a robot \(0.77 m from its base\) in 0 of 100 draws",
    ):
        Belief(far, "milk", robots).sample(0)


def test_a_region_off_its_support_says_so(task, robots):
    off = moved(task, "slot_a", center=(1.19, 0.0))
    with pytest.raises(TaskInfeasibleError, match=r"milk in region slot_a is on its support floor in \d+ of 100 draws"):
        Belief(off, "milk", robots).sample(0)


def test_an_unknown_scene_is_refused(task, robots):
    with pytest.raises(UnknownNameError, match="milkk"):
        Belief(task, "milkk", robots)


@pytest.mark.parametrize(
    ("distribution", "holds"),
    [
        (Distribution(constant=[1.0, 2.0]), lambda v: np.array_equal(v, [1, 2])),
        (Distribution(uniform=([-1.0, 2.0], [0.0, 3.0])), lambda v: -1 <= v[0] <= 0 and 2 <= v[1] <= 3),
        (Distribution(normal=(5.0, 0.001)), lambda v: abs(v - 5) < 0.01),
        (Distribution(choice=[0.0, 90.0]), lambda v: v in (0.0, 90.0)),
        (Distribution(choice=[[0.0, 1.0], [2.0, 3.0]]), lambda v: v.tolist() in ([0, 1], [2, 3])),
    ],
    ids=["constant", "uniform", "normal", "choice", "choice of points"],
)
def test_each_distribution_draws_what_it_says(distribution, holds):
    from dm_control.composer import variation

    draws = [variation.evaluate(as_variation(distribution), random_state=np.random.RandomState(s)) for s in range(20)]
    assert all(holds(d) for d in draws)
    if distribution.constant is None:
        assert len({np.asarray(d).tobytes() for d in draws}) > 1


def test_yaw_turns_what_is_placed(task, robots):
    turned = moved(task, "slot_a", yaw_deg=Distribution(constant=30.0))
    assert np.degrees(yaw_of(Belief(turned, "butter", robots).sample(0).poses["butter"])) == pytest.approx(30)


def test_discs_are_apart_by_centres_less_radii():
    a, b = footprint(CAN, np.array([0.0, 0.0]), 0.0), footprint(CAN, np.array([0.3, 0.4]), 1.0)
    assert clearance(a, b) == pytest.approx(0.5 - 0.06)


def test_gap_is_symmetric_moves_along_and_agrees_with_opencv():
    random = np.random.default_rng(0)
    for _ in range(200):
        xy, yaw = random.uniform(-0.1, 0.1, (2, 2)), random.uniform(-np.pi, np.pi, 2)
        a, b = footprint(BOX, xy[0], yaw[0]), footprint(BOX, xy[1], yaw[1])
        shift = np.array([0.3, -0.2])
        assert clearance(a, b) == pytest.approx(clearance(b, a))
        assert clearance(a, b) == pytest.approx(clearance(*(footprint(BOX, xy[i] + shift, yaw[i]) for i in (0, 1))))
        rectangles = [((1e3 * xy[i]).tolist(), (80.0, 40.0), float(np.degrees(yaw[i]))) for i in (0, 1)]
        apart = cv2.rotatedRectangleIntersection(*rectangles)[0] == cv2.INTERSECT_NONE
        if abs(clearance(a, b)) > 1e-5:
            assert (clearance(a, b) > 0) == apart


def test_a_disc_inside_a_box_overlaps_it():
    assert clearance(footprint(CAN, np.zeros(2), 0.0), footprint(BOX, np.array([0.01, 0.0]), 0.5)) < 0
