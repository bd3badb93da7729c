"""The fake arm keeps the contract for contacts: it feels, stops at a touch and gives way within its limits."""

import numpy as np
import pytest

from gap_runtime.contracts.arm import NO_WRENCH, Compliance
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Trajectory, Vec3, Wrench
from gap_runtime.testing import FakeCell
from gap_runtime.testing.arm import FORCE

WAY = Trajectory(np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 1.0]]))
PUSH = Wrench(Vec3(0.0, 0.0, -12.0), Vec3(0.0, 0.0, 0.0))


@pytest.fixture
def arm():
    made = FakeCell().arms[0]
    made.felt = lambda time: PUSH if time > 0.5 else NO_WRENCH
    return made


@pytest.mark.parametrize(("force", "reason", "share"), [(10.0, "contact", 0.5), (15.0, "reached", 1.0)])
def test_a_guarded_motion_ends_where_it_touches(arm, force, reason, share):
    ended = arm.move_guarded(WAY, force=force)
    assert ended.reason == reason and ended.wrench == PUSH
    np.testing.assert_allclose(arm.state().joints.positions, share, atol=0.03)


def test_a_guarded_motion_counts_from_what_is_felt_at_its_start(arm):
    arm.felt = lambda time: PUSH
    assert arm.move_guarded(WAY, force=10.0).reason == "reached"


@pytest.mark.parametrize(("timeout", "reason", "share"), [(3.0, "reached", 1.0), (1.0, "timeout", 0.5)])
def test_a_compliant_motion_goes_as_far_as_its_time_allows(arm, timeout, reason, share):
    start = arm.state().ee_pose
    target = start.moved([0.0, 0.0, -0.1])
    ended = arm.move_compliant(target, Compliance(start, (300.0,) * 6), force_limit=20.0, timeout=timeout)
    assert ended.reason == reason and ended.pose == arm.state().ee_pose
    np.testing.assert_allclose(ended.pose.position.z, start.position.z - 0.1 * share, atol=2e-3)


def test_a_compliant_motion_fails_beyond_its_force_limit(arm):
    start = arm.state().ee_pose
    with pytest.raises(MotionError) as error:
        arm.move_compliant(start.moved([0, 0, 0.1]), Compliance(start, (0.0,) * 6), force_limit=10.0, timeout=5.0)
    assert error.value.code == "force"


def test_jaws_hold_what_they_find(arm):
    jaws = arm.gripper
    assert not jaws.close().holding and jaws.set_force(5.0).force == 0.0
    jaws.open()
    jaws.object_width = 0.03
    state = jaws.close()
    assert (state.width, state.force, state.holding) == (0.03, FORCE, True)
    assert jaws.set_force(5.0).force == 5.0 and not jaws.open().holding
