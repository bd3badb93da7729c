"""grasp-direct-ik: orientation, depth and neighbours, on every registered arm."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_runtime.contracts.types import GripperState, Obstacle, WorldConfig
from gap_runtime.errors import GraspError, PlanningError
from tests.unit.skills.stage import ROBOTS, Stage, box, cloud, script

run = script("grasp-direct-ik", "plan_grasp")
require_held = script("grasp-direct-ik", "require_held")
EMPTY = WorldConfig()
on_every_arm = pytest.mark.parametrize("spec", ROBOTS, ids=lambda s: s.name)


def standing(size, yaw=0.0, at=(0.0, 0.0)):
    return box((*at, size[2] / 2), size, yaw)


def world(*boxes):
    return WorldConfig(tuple(Obstacle(f"obstacle_{i}", b, cloud(b)) for i, b in enumerate(boxes)))


def axis(pose, of):
    return pose.rotation.rotation.apply(of)


@on_every_arm
@pytest.mark.parametrize("yaw", [0.0, 0.4, 1.2, -0.9])
@pytest.mark.parametrize("size", [(0.08, 0.04, 0.02), (0.04, 0.07, 0.1), (0.05, 0.05, 0.13)])
def test_jaws_close_across_the_narrow_side(spec, size, yaw):
    obb = standing(size, yaw)
    plan = run(Stage(spec), obb, EMPTY)
    assert plan.width == pytest.approx(min(size[:2]))
    assert axis(plan.grasp_pose, [0, 0, 1]) == pytest.approx([0, 0, -1], abs=1e-9)
    across = np.abs(obb.orientation.rotation.inv().apply(axis(plan.grasp_pose, [0, 1, 0])))
    assert across.max() == pytest.approx(1)
    assert plan.grasp_pose.position.array[:2] == pytest.approx([0, 0], abs=1e-9)


@on_every_arm
@pytest.mark.parametrize("height", [0.012, 0.02, 0.05, 0.1, 0.2])
def test_fingertips_clear_the_support_and_the_palm_the_top(spec, height):
    plan = run(Stage(spec), standing((0.04, 0.04, height)), EMPTY, support_clearance=0.004, palm_clearance=0.006)
    z, hand = plan.grasp_pose.position.z, spec.gripper
    assert z - hand.finger_size[2] >= 0.004 - 1e-9
    assert z + hand.finger_depth >= height + 0.006 - 1e-9
    wished = height / 2
    limits = [wished, hand.finger_size[2] + 0.004, height - hand.finger_depth + 0.006]
    assert z == pytest.approx(max(limits))


@on_every_arm
def test_the_hand_comes_straight_down_its_own_axis(spec):
    plan = run(Stage(spec), standing((0.04, 0.06, 0.1)), EMPTY, approach_offset=0.1)
    way = plan.grasp_pose.position.array - plan.hover_pose.position.array
    assert way == pytest.approx(np.linalg.norm(way) * axis(plan.grasp_pose, [0, 0, 1]))
    assert np.linalg.norm(way) >= 0.1 - 1e-9
    assert plan.hover_pose.rotation == plan.grasp_pose.rotation


@on_every_arm
def test_what_stands_on_the_way_is_passed_over(spec):
    wall = box((-0.08, 0.0, 0.1), (0.02, 0.3, 0.2))
    plan = run(Stage(spec), standing((0.04, 0.04, 0.05), at=(0.1, 0.0)), world(wall), pass_over=0.03)
    assert plan.hover_pose.position.z >= 0.2 + spec.gripper.finger_size[2] + 0.03 - 1e-9


@on_every_arm
def test_a_neighbour_turns_the_hand_where_both_sides_fit(spec):
    beside = [standing((0.03, 0.03, 0.12), at=(0.0, y)) for y in (-0.09, 0.09)]
    obb = standing((0.05, 0.049, 0.03))
    alone, crowded = run(Stage(spec), obb, EMPTY), run(Stage(spec), obb, world(*beside))
    assert abs(axis(alone.grasp_pose, [0, 1, 0])[1]) > 0.99
    assert abs(axis(crowded.grasp_pose, [0, 1, 0])[0]) > 0.99


@on_every_arm
def test_a_long_object_is_taken_off_its_middle_away_from_a_neighbour(spec):
    obb = standing((0.10, 0.04, 0.02))
    beside = [standing((0.03, 0.03, 0.09), at=(0.035, y)) for y in (-0.075, 0.075)]
    plan = run(Stage(spec), obb, world(*beside), max_tilt_deg=0.0)
    assert -0.05 + spec.gripper.finger_size[1] <= plan.grasp_pose.position.x < -0.005
    assert plan.grasp_pose.position.y == pytest.approx(0, abs=1e-9)


@on_every_arm
def test_nothing_round_is_taken_off_its_middle(spec):
    beside = [standing((0.03, 0.03, 0.09), at=(x, y)) for x in (-0.08, 0.02) for y in (-0.08, 0.08)]
    plan = run(Stage(spec), standing((0.06, 0.058, 0.08)), world(*beside), tolerated_contact=1.0)
    assert plan.grasp_pose.position.array[:2] == pytest.approx([0, 0], abs=1e-9)


def test_a_lean_keeps_the_jaws_level_and_the_fingertips_off_the_support():
    spec = ROBOTS[0]
    beside = [standing((0.04, 0.03, 0.09), at=(x, y)) for x in (0.0, 0.045) for y in (-0.08, 0.08)]
    plan = run(Stage(spec), standing((0.08, 0.04, 0.02)), world(*beside), max_tilt_deg=30.0, tolerated_contact=1.0)
    assert axis(plan.grasp_pose, [0, 1, 0])[2] == pytest.approx(0, abs=1e-9)
    _, wide, tip = spec.gripper.finger_size
    corners = [axis(plan.grasp_pose, [x, 0, tip]) + plan.grasp_pose.position.array for x in (-wide, wide)]
    assert min(c[2] for c in corners) >= 0.004 - 1e-9


@on_every_arm
def test_what_the_jaws_cannot_span_is_refused(spec):
    wide = spec.gripper.max_width + 0.001
    with pytest.raises(GraspError, match="mm wide at its narrowest") as caught:
        run(Stage(spec), standing((wide, wide, 0.05)), EMPTY)
    assert caught.value.code == "too_wide"


@on_every_arm
def test_a_walled_in_object_is_refused(spec):
    ring = [
        standing((0.05, 0.05, 0.15), at=(x, y)) for x in (-0.06, 0, 0.06) for y in (-0.06, 0, 0.06) if (x, y) != (0, 0)
    ]
    with pytest.raises(PlanningError, match="inside the hand's way down") as caught:
        run(Stage(spec), standing((0.04, 0.04, 0.03)), world(*ring))
    assert caught.value.code == "blocked"


@pytest.mark.parametrize("raises", [True, False])
def test_what_no_arm_reaches_is_refused(raises):
    def solve(**_):
        if raises:
            raise PlanningError("unreachable", "too far")
        return SimpleNamespace(success=False, joint_config=None)

    with pytest.raises(PlanningError) as caught:
        run(Stage(ROBOTS[0], pyroki__SolveIK=solve), standing((0.04, 0.04, 0.03)), EMPTY)
    assert caught.value.code == "unreachable"


def test_the_target_itself_is_no_obstacle():
    obb = standing((0.04, 0.06, 0.08))
    same = WorldConfig((Obstacle("target", obb, cloud(obb)),))
    assert run(Stage(ROBOTS[0]), obb, same) == run(Stage(ROBOTS[0]), obb, EMPTY)


def test_jaws_closed_on_nothing_raise():
    require_held(None, GripperState(0.03, 0.4), 0.04)
    with pytest.raises(GraspError, match=r"closed to 0\.4 mm") as caught:
        require_held(None, GripperState(0.0004, 0.0), 0.04)
    assert caught.value.code == "nothing_held"
