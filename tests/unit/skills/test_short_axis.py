"""grasp-short-axis: the jaws' axis is the box's, and a base makes them slide away from it."""

from __future__ import annotations

import pytest
from scipy.spatial.transform import Rotation

from gap_runtime.errors import GraspError
from tests.unit.skills.stage import ROBOTS, Stage, box, script

run = script("grasp-short-axis", "short_axis_grasp")
on_every_arm = pytest.mark.parametrize("spec", ROBOTS, ids=lambda s: s.name)


@on_every_arm
@pytest.mark.parametrize("yaw", [0.0, 0.5, 1.4, -1.1])
def test_the_jaws_close_across_the_shorter_axis(spec, yaw):
    plan = run(Stage(spec), box((0.1, 0.0, 0.02), (0.16, 0.025, 0.04), yaw))
    short = Rotation.from_euler("z", yaw).apply([0, 1, 0])
    assert abs(plan.grasp_pose.rotation.rotation.apply([0, 1, 0]) @ short) == pytest.approx(1)
    assert plan.width == pytest.approx(0.025)
    assert plan.grasp_pose.position.array[:2] == pytest.approx([0.1, 0.0])


@on_every_arm
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
def test_with_a_base_the_grasp_slides_away_from_it(spec, side, fraction):
    handle = box((0.0, 0.0, 0.05), (0.16, 0.025, 0.02), 0.5)
    along = Rotation.from_euler("z", 0.5).apply([1, 0, 0])
    base = box(-side * 0.2 * along + [0, 0, 0.03], (0.2, 0.2, 0.06))
    plan = run(Stage(spec), handle, base, slide_fraction=fraction)
    slid = plan.grasp_pose.position.array @ along
    assert slid == pytest.approx(side * fraction * (0.08 - spec.gripper.finger_size[1] - 0.004))
    assert plan.grasp_pose.position.array[:2] == pytest.approx(slid * along[:2], abs=1e-9)


@on_every_arm
def test_fingertips_stay_above_the_bottom_and_the_palm_above_the_top(spec):
    for height in (0.012, 0.05, 0.2):
        plan = run(Stage(spec), box((0, 0, 0.3 + height / 2), (0.1, 0.03, height)))
        z = plan.grasp_pose.position.z
        assert z - spec.gripper.finger_size[2] >= 0.3 + 0.004 - 1e-9
        assert z + spec.gripper.finger_depth >= 0.3 + height + 0.006 - 1e-9


def test_what_the_jaws_cannot_span_is_refused():
    with pytest.raises(GraspError, match="across its shorter axis"):
        run(Stage(ROBOTS[0]), box((0, 0, 0.1), (0.3, 0.1, 0.1)))
