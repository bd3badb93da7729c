"""Two arms on one clock: the same ones, one of each kind, side by side or facing each other."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_mujoco.simulator import MujocoSimulator
from gap_robots.panda import SIDE_BY_SIDE
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.task import RobotPlacement
from gap_runtime.contracts.types import JointState, Se3Pose, Vec3
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
REGISTRY = load_registry(("gap_robots", "gap_motion"), entry_points=False)
FACING = ((-0.6, 0.0, 0.0), 0.0), ((0.75, 0.0, 0.0), 180.0)
BESIDE = ((-0.6, -SIDE_BY_SIDE / 2, 0.0), 0.0), ((-0.6, SIDE_BY_SIDE / 2, 0.0), 0.0)
PAIRS = {
    "two pandas": (("panda", "panda"), FACING),
    "bimanual": (("panda-bimanual", "panda-bimanual"), BESIDE),
    "panda and ur5e": (("panda", "ur5e"), FACING),
}


@pytest.fixture(scope="module", params=PAIRS)
def made(request, task):
    models, places = PAIRS[request.param]
    robots = [RobotPlacement(model=m, position=p, yaw_deg=y) for m, (p, y) in zip(models, places, strict=True)]
    environment = task.environment.model_copy(update={"workspace": ((-1.0, -1.0, -0.2), (1.0, 1.0, 1.2))})
    cell = task.model_copy(update={"robots": robots, "environment": environment})
    world = MujocoSimulator(cell, "milk", {m: REGISTRY.robot(m) for m in models})
    world.task = cell
    yield world
    world.close()


@pytest.fixture
def cell(made):
    context = SimpleNamespace(
        cell=made, task=made.task, state={}, seed=0, robot=lambda arm_id=0: made.arms[arm_id].spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
    )  # fmt: skip
    made.reset(made.sample(1))
    speeds = []
    made._physics.observers.append(lambda: speeds.append([np.abs(a.controller.velocity).max() for a in made.arms]))
    yield SimpleNamespace(
        cell=made, arms=made.arms, speeds=speeds,
        call=lambda name, **inputs: REGISTRY.tool(name)(context, **inputs),
    )  # fmt: skip
    made._physics.observers.clear()


def beyond(cell, arm_id, x=0.0, y=0.0, z=0.0):
    """A pose beyond where an arm's TCP is now."""
    pose = cell.arms[arm_id].state().ee_pose
    p = pose.position
    return Se3Pose(Vec3(p.x + x, p.y + y, p.z + z), pose.rotation)


def apart(cell):
    """To either side, so that the arms do not meet: towards lower y for arm 0."""
    return beyond(cell, 0, y=-0.15, z=-0.1), beyond(cell, 1, y=0.2, z=-0.05)


def off(cell, arm_id, pose):
    return np.linalg.norm(cell.arms[arm_id].state().ee_pose.position.array - pose.position.array)


def test_both_tcps_arrive_and_start_and_end_at_the_same_instant(cell):
    poses = apart(cell)
    cell.call("robot_control.GoToPoseBoth", pose_arm0=poses[0], pose_arm1=poses[1])
    assert max(off(cell, i, pose) for i, pose in enumerate(poses)) < 2e-3
    moving = np.array(cell.speeds) > 1e-3
    first, last = moving.argmax(axis=0), len(moving) - moving[::-1].argmax(axis=0)
    assert np.abs(np.diff(first)).max() <= 20 and np.abs(np.diff(last)).max() <= 20  # steps of 2 ms


def test_joints_of_both_arrive_and_home_is_reached_together(cell):
    goals = [JointState(np.array(arm.spec.home) + sign * 0.15) for arm, sign in zip(cell.arms, (-1, 1), strict=True)]
    cell.call("robot_control.MoveToJointsBoth", joints_arm0=goals[0], joints_arm1=goals[1], tolerance=0.01)
    for arm, goal in zip(cell.arms, goals, strict=True):
        np.testing.assert_allclose(arm.state().joints.positions, goal.positions, atol=2e-3)
    cell.call("robot_control.GoHome")
    for arm in cell.arms:
        np.testing.assert_allclose(arm.state().joints.positions, arm.spec.home, atol=2e-3)
    began = cell.cell.time
    cell.call("robot_control.GoHome")
    assert cell.cell.time < began + 0.1


def test_one_of_two_moves_and_the_other_stays(cell):
    goal = beyond(cell, 1, y=0.2, z=-0.1)
    cell.call("robot_control.GoToPoseArm", arm_id=1, pose=goal)
    assert off(cell, 1, goal) < 2e-3
    np.testing.assert_allclose(cell.arms[0].state().joints.positions, cell.arms[0].spec.home, atol=1e-3)


def test_an_arm_under_way_goes_on_while_the_other_moves(cell):
    first, second = apart(cell)
    cell.call("robot_control.GoToPose", pose=first, nonblocking=True)
    assert cell.cell.time == 0
    cell.call("robot_control.GoToPoseArm", arm_id=1, pose=second)
    together = cell.cell.time
    cell.arms[0].finish()
    assert off(cell, 0, first) < 2e-3 and off(cell, 1, second) < 2e-3
    assert (np.array(cell.speeds).min(axis=1) > 0.05).any() and cell.cell.time < 1.5 * together


def test_when_one_of_two_meets_the_floor_both_stop(cell):
    under = beyond(cell, 1, z=-cell.arms[1].state().ee_pose.position.z - 0.05)
    away = beyond(cell, 0, x=-0.05, y=-0.3)
    with pytest.raises(MotionError) as error:
        cell.call("robot_control.GoToPoseBoth", pose_arm0=away, pose_arm1=under)
    assert error.value.code == "contact"
    cell.cell.wait(0.2)
    assert max(np.abs(arm.state().joints.velocities).max() for arm in cell.arms) < 0.02
    assert off(cell, 0, away) > 0.01
    cell.call("robot_control.GoHome")
