from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_cli.rehearse.state_diff import changes
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3
from gap_runtime.testing import FakeCell


@pytest.fixture
def before():
    return FakeCell(objects={"can": Vec3(0.0, 0.0, 0.1), "bin": Vec3(0.3, 0.0, 0.1)}).snapshot()


def with_body(snapshot, name, **values):
    return replace(snapshot, bodies={**snapshot.bodies, name: replace(snapshot.bodies[name], **values)})


def test_nothing_changed_says_nothing(before):
    assert changes(before, before) == {}


def test_a_moved_body_and_only_it_is_listed(before):
    pose = before.bodies["can"].pose
    after = with_body(before, "can", pose=Se3Pose(Vec3(0.0, 0.02, 0.15), pose.rotation))
    assert list(changes(before, after)) == ["can"]
    assert np.allclose(changes(before, after)["can"]["moved"], [0.0, 0.02, 0.05])


def test_a_turn_is_its_angle_about_any_axis(before):
    turned = Quaternion.of(Rotation.from_rotvec(np.radians(30) * np.array([0.0, 0.6, 0.8])))
    after = with_body(before, "can", pose=Se3Pose(before.bodies["can"].pose.position, turned))
    assert changes(before, after)["can"] == {"turned_deg": pytest.approx(30)}


def test_contacts_come_and_go(before):
    after = with_body(before, "can", contacts=frozenset({"robot:0:left_finger", "bin"}))
    assert changes(before, after)["can"]["contacts"] == ["+bin", "+robot:0:left_finger", "-floor"]


def test_jaws_and_tcp_belong_to_their_arm(before):
    arm = before.arms[0]
    moved = replace(arm, gripper_width=0.02, tcp=Se3Pose(Vec3(9.0, 0.0, 0.0), arm.tcp.rotation))
    found = changes(before, replace(before, arms=(moved,)))
    assert list(found) == ["arm:0"]
    assert found["arm:0"]["gripper"] == [arm.gripper_width, 0.02]
    assert "tcp_moved" in found["arm:0"]


def test_articulated_joints_are_seen(before):
    a, b = replace(before, joints={"door": 0.0}), replace(before, joints={"door": 0.4})
    assert changes(a, b) == {"door": {"position": [0.0, 0.4]}}
