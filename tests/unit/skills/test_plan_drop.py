"""transport-to-drop: heights, fit and place of a drop, on every registered arm."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.types import GripperState, Obstacle, Quaternion, Se3Pose, Vec3, WorldConfig
from gap_runtime.errors import GraspError, PlanningError
from tests.unit.skills.stage import DOWN, ROBOTS, Stage, box, cloud, script

run = script("transport-to-drop", "plan_drop")
require_still_held = script("transport-to-drop", "require_still_held")
EMPTY = WorldConfig()
BASKET = box((0.1, 0.3, 0.08), (0.18, 0.18, 0.16), 0.3)
on_every_arm = pytest.mark.parametrize("spec", ROBOTS, ids=lambda s: s.name)


def held(size, yaw=0.0, off=(0.0, 0.0), below=None):
    """An object as it stood, and the hand that took it `below` its top (default: in the middle)."""
    obb = box((-0.1, -0.2, size[2] / 2), size, yaw)
    z = size[2] - (size[2] / 2 if below is None else below)
    turned = Quaternion.of(Rotation.from_euler("z", yaw) * DOWN.rotation)
    return obb, Se3Pose(Vec3(-0.1 + off[0], -0.2 + off[1], z), turned)


def carried(obb, grasp, pose):
    """Corners of the object when the hand that took it at `grasp` is at `pose`."""
    turned = (pose.rotation.rotation * grasp.rotation.rotation.inv()).as_matrix()
    return (obb.corners - grasp.position.array) @ turned.T + pose.position.array


@on_every_arm
@pytest.mark.parametrize("size", [(0.08, 0.04, 0.02), (0.05, 0.05, 0.13)])
@pytest.mark.parametrize("off", [(0.0, 0.0), (0.02, -0.01)])
def test_the_object_is_carried_clear_and_let_go_over_the_middle(spec, size, off):
    obb, grasp = held(size, 0.7, off)
    plan = run(Stage(spec), BASKET, obb, grasp, EMPTY, clearance=0.04, rim_clearance=0.01)
    on_the_way, at_the_end = carried(obb, grasp, plan.carry_pose), carried(obb, grasp, plan.release_pose)
    assert on_the_way[:, 2].min() >= 0.16 + 0.04 - 1e-9
    middle = (at_the_end.max(axis=0) + at_the_end.min(axis=0)) / 2
    assert middle[:2] == pytest.approx([0.1, 0.3], abs=1e-6)
    assert plan.release_pose.position.z - spec.gripper.finger_size[2] >= 0.16 + 0.01 - 1e-9
    assert plan.release_pose.position.z <= plan.carry_pose.position.z


@on_every_arm
def test_the_lift_is_straight_up(spec):
    obb, grasp = held((0.05, 0.05, 0.1))
    plan = run(Stage(spec), BASKET, obb, grasp, EMPTY)
    assert plan.lift_pose.position.array[:2] == pytest.approx(grasp.position.array[:2])
    assert plan.lift_pose.rotation == grasp.rotation
    assert plan.lift_pose.position.z >= plan.carry_pose.position.z


@on_every_arm
def test_a_tall_object_is_let_go_deeper_than_a_flat_one(spec):
    bottoms = []
    for size in ((0.05, 0.05, 0.14), (0.05, 0.05, 0.02)):
        obb, grasp = held(size, below=0.01)
        plan = run(Stage(spec), BASKET, obb, grasp, EMPTY)
        bottoms.append(carried(obb, grasp, plan.release_pose)[:, 2].min())
    assert bottoms[0] < bottoms[1]
    assert bottoms[0] > 0


@on_every_arm
def test_something_tall_beside_the_way_is_passed_over(spec):
    obb, grasp = held((0.05, 0.05, 0.1))
    tower = box((0.0, 0.05, 0.15), (0.04, 0.04, 0.3))
    plan = run(Stage(spec), BASKET, obb, grasp, WorldConfig((Obstacle("tower", tower, cloud(tower)),)), clearance=0.04)
    assert carried(obb, grasp, plan.carry_pose)[:, 2].min() >= 0.3 + 0.04 - 1e-9


@on_every_arm
def test_content_on_one_side_moves_the_drop_to_the_other(spec):
    obb, grasp = held((0.04, 0.04, 0.06))
    side = Rotation.from_euler("z", 0.3).apply([0.04, 0.0, 0.0])
    inside = box(np.array([0.1, 0.3, 0.06]) + side, (0.04, 0.1, 0.12), 0.3)
    full = WorldConfig((Obstacle("content", inside, cloud(inside)),))
    plan = run(Stage(spec), BASKET, obb, grasp, full, rim_width=0.02)
    at_the_end = carried(obb, grasp, plan.release_pose)
    middle = (at_the_end.max(axis=0) + at_the_end.min(axis=0)) / 2
    assert (middle - BASKET.center.array) @ side < -0.0005


@on_every_arm
@pytest.mark.parametrize("total", [2, 3, 4])
def test_objects_that_share_a_container_get_parts_of_it(spec, total):
    obb, grasp = held((0.05, 0.05, 0.1))
    middles = []
    for nth in range(total):
        plan = run(Stage(spec), BASKET, obb, grasp, EMPTY, nth, total)
        at_the_end = carried(obb, grasp, plan.release_pose)
        middles.append((at_the_end.max(axis=0) + at_the_end.min(axis=0))[:2] / 2)
    apart = [np.linalg.norm(a - b) for i, a in enumerate(middles) for b in middles[:i]]
    assert min(apart) >= 0.05 - 1e-9
    assert apart[0] == pytest.approx(max(apart))


@on_every_arm
def test_over_a_full_container_the_object_stays_above_the_content(spec):
    obb, grasp = held((0.05, 0.05, 0.14), below=0.01)
    inside = box((0.1, 0.3, 0.075), (0.12, 0.12, 0.15), 0.3)
    full = WorldConfig((Obstacle("content", inside, cloud(inside, 21)),))
    plan = run(Stage(spec), BASKET, obb, grasp, full, above_content=0.01)
    assert carried(obb, grasp, plan.release_pose)[:, 2].min() >= 0.15 + 0.01 - 1e-9


@on_every_arm
def test_an_object_too_long_as_held_is_turned_to_the_sides(spec):
    obb, grasp = held((0.12, 0.03, 0.03), yaw=0.3 + np.pi / 4)
    plan = run(Stage(spec), BASKET, obb, grasp, EMPTY, rim_width=0.025)
    local = BASKET.orientation.rotation.inv().apply(carried(obb, grasp, plan.release_pose) - BASKET.center.array)
    assert np.abs(local[:, :2]).max() <= 0.09 - 0.025 + 1e-9


def test_what_does_not_fit_is_refused():
    obb, grasp = held((0.2, 0.03, 0.03))
    with pytest.raises(PlanningError, match="too wide for the opening") as caught:
        run(Stage(ROBOTS[0]), BASKET, obb, grasp, EMPTY)
    assert caught.value.code == "does_not_fit"


@pytest.mark.parametrize("raises", [True, False])
def test_a_container_out_of_reach_is_refused(raises):
    def solve(target_pose, **_):
        if raises:
            raise PlanningError("unreachable", "too far")
        return SimpleNamespace(success=False)

    obb, grasp = held((0.04, 0.04, 0.1))
    with pytest.raises(PlanningError) as caught:
        run(Stage(ROBOTS[0], pyroki__SolveIK=solve), BASKET, obb, grasp, EMPTY)
    assert caught.value.code == "unreachable"


def test_an_object_lost_on_the_way_up_raises():
    obb, _ = held((0.08, 0.04, 0.1))
    require_still_held(None, GripperState(0.03, 0.4), obb)
    with pytest.raises(GraspError, match="after the lift") as caught:
        require_still_held(None, GripperState(0.001, 0.0), obb)
    assert caught.value.code == "lost"
