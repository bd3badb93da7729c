"""grasp-curobo-obb: which grasps a planner is offered."""

from __future__ import annotations

import numpy as np
import pytest

from gap_runtime.errors import GraspError
from tests.unit.skills.stage import ROBOTS, Stage, box, script

run = script("grasp-curobo-obb", "obb_candidates")
choose = script("grasp-curobo-obb", "chosen_grasp")
on_every_arm = pytest.mark.parametrize("spec", ROBOTS, ids=lambda s: s.name)


@on_every_arm
@pytest.mark.parametrize("size", [(0.08, 0.04, 0.02), (0.05, 0.05, 0.13), (0.12, 0.06, 0.01)])
def test_every_grasp_offered_fits_the_jaws_and_clears_the_support(spec, size):
    obb = box((0.1, 0.2, size[2] / 2), size, 0.7)
    found = run(Stage(spec), obb, support_clearance=0.006)
    assert len(found.poses) == len(found.widths) > 1
    _, wide, tip = spec.gripper.finger_size
    for pose, width in zip(found.poses, found.widths, strict=True):
        closing = pose.rotation.rotation.apply([0, 1, 0])
        assert closing[2] == pytest.approx(0, abs=1e-9)
        assert obb.extent_along(closing) == pytest.approx(width)
        assert width <= spec.gripper.max_width - 2 * 0.003
        lowest = min(pose.moved([x, 0, tip]).position.z for x in (-wide, wide))
        assert lowest >= 0.006 - 1e-9


@on_every_arm
def test_only_long_objects_are_offered_off_their_middle(spec):
    for size, spread in (((0.06, 0.055, 0.08), 0.0), ((0.12, 0.04, 0.02), 0.03)):
        poses = run(Stage(spec), box((0, 0, size[2] / 2), size), max_shift=0.03).poses
        assert max(np.hypot(p.position.x, p.position.y) for p in poses) == pytest.approx(spread)


@on_every_arm
def test_leans_are_bounded_and_come_in_pairs(spec):
    poses = run(Stage(spec), box((0, 0, 0.01), (0.08, 0.04, 0.02)), max_tilt_deg=20.0).poses
    leans = sorted({round(float(np.degrees(np.arcsin(p.rotation.rotation.apply([0, 0, 1])[0])))) for p in poses})
    assert leans == [-15, 0, 15]


@on_every_arm
def test_each_grasp_comes_with_the_jaws_exchanged(spec):
    poses = run(Stage(spec), box((0, 0, 0.05), (0.05, 0.03, 0.1)), max_tilt_deg=0.0).poses
    closing = np.array([p.rotation.rotation.apply([0, 1, 0]) for p in poses])
    assert np.allclose(closing.sum(axis=0), 0)


@on_every_arm
def test_what_the_jaws_cannot_span_is_refused(spec):
    wide = spec.gripper.max_width
    with pytest.raises(GraspError, match="at its narrowest"):
        run(Stage(spec), box((0, 0, 0.05), (wide, wide, 0.1)))


def test_the_chosen_grasp_is_the_one_the_planner_names():
    found = run(Stage(ROBOTS[0]), box((0, 0, 0.05), (0.05, 0.03, 0.1)))
    assert choose(None, found.poses, found.widths, 3) == (found.poses[3], found.widths[3])
