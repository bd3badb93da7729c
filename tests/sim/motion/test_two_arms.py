"""Two arms in one cell, in lock-step and in parallel branches."""

from __future__ import annotations

import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gap_runtime.contracts.encoding.codec import to_plain
from gap_runtime.contracts.failures import BadRequestError, MotionError
from gap_runtime.contracts.task import load_task
from gap_runtime.contracts.types import JointState, Quaternion, Se3Pose, Vec3
from gap_runtime.plugins import load_registry
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import compile_fake, fake_workflow

pytestmark = pytest.mark.sim
DOWN = Quaternion(0.0, 1.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def cell():
    registry = load_registry(entry_points=False)
    task = load_task(Path(__file__).parents[3] / "tasks" / "fulfill-grocery", "two-arms")
    world = registry.cells["mujoco"].value(
        task, "alphabet_soup", {r.model: registry.robot(r.model) for r in task.robots}
    )
    context = SimpleNamespace(
        cell=world, task=task, state={}, seed=0, robot=lambda arm_id=0: world.arms[arm_id].spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
        renderer=registry.renderer,
    )  # fmt: skip
    world.reset(world.sample(0))
    yield SimpleNamespace(
        cell=world, task=task, tools=registry.tools, call=lambda name, **inputs: registry.tool(name)(context, **inputs)
    )
    world.close()


def tcp(cell, arm):
    return cell.call("robot_control.GetEEPose", arm_id=arm).pose.position


def test_both_arrive_together_and_one_alone_leaves_the_other(cell):
    home = JointState(cell.cell.arms[0].spec.home)
    poses = [Se3Pose(Vec3(-0.15, 0.2, 0.35), DOWN), Se3Pose(Vec3(0.1, -0.25, 0.35), DOWN)]

    def seconds(name, **inputs):
        cell.call("robot_control.MoveToJointsBoth", joints_arm0=home, joints_arm1=home)
        began = cell.cell.time
        cell.call(name, **inputs)
        return cell.cell.time - began

    alone = []
    for arm, pose in enumerate(poses):
        alone.append(seconds("robot_control.GoToPoseArm", arm_id=arm, pose=pose))
        other = cell.cell.arms[1 - arm].state().joints.positions
        np.testing.assert_allclose(other, home.positions, atol=5e-3)
    together = seconds("robot_control.GoToPoseBoth", pose_arm0=poses[0], pose_arm1=poses[1])
    assert together == pytest.approx(max(alone), rel=0.2)
    for arm, pose in enumerate(poses):
        np.testing.assert_allclose(tcp(cell, arm).array, pose.position.array, atol=5e-3)


def test_arms_that_would_meet_are_refused_before_they_move(cell):
    before = [arm.state().joints.positions for arm in cell.cell.arms]
    spot = Se3Pose(Vec3(0.05, 0.0, 0.3), DOWN)
    with pytest.raises(MotionError) as error:
        cell.call("robot_control.GoToPoseBoth", pose_arm0=spot, pose_arm1=spot)
    assert error.value.code == "refused" and error.value.detail["why"] == "arms_meet"
    for arm, q in zip(cell.cell.arms, before, strict=True):
        np.testing.assert_array_equal(arm.state().joints.positions, q)


def test_the_other_arm_is_an_obstacle_to_a_planner(cell):
    from gap_runtime.contracts.failures import PlanningError

    home = JointState(cell.cell.arms[0].spec.home)
    cell.call("robot_control.MoveToJointsBoth", joints_arm0=home, joints_arm1=home)
    spot = Se3Pose(Vec3(0.1, -0.25, 0.35), DOWN)
    cell.call("robot_control.GoToPoseArm", arm_id=1, pose=spot)
    start = cell.cell.arms[0].state().joints
    with pytest.raises(PlanningError) as error:
        cell.call("curobo.PlanToPose", target_pose=spot, start_joint_position=start)
    assert error.value.code == "in_collision" and "arm:1:" in str(error.value.detail["pair"])


def test_joints_of_both_go_home_and_count_is_checked(cell):
    home = cell.cell.arms[0].spec.home
    with pytest.raises(BadRequestError):
        cell.call("robot_control.MoveToJointsBoth", joints_arm0=JointState(home), joints_arm1=JointState(home[:-1]))
    cell.call("robot_control.MoveToJointsBoth", joints_arm0=JointState(home), joints_arm1=JointState(home))
    for arm in cell.cell.arms:
        np.testing.assert_allclose(arm.state().joints.positions, home, atol=0.02)


def test_a_policy_action_moves_the_tcp_by_its_delta(cell):
    before = tcp(cell, 0)
    cell.call("robot_control.ApplyPolicyAction", action=[0.5, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0])
    cell.cell.wait(1.0)
    after = tcp(cell, 0)
    np.testing.assert_allclose(after.array - before.array, [0.025, 0.0, -0.05], atol=1e-3)
    assert cell.call("gripper.GetPosition").width < 0.01
    with pytest.raises(BadRequestError):
        cell.call("robot_control.ApplyPolicyAction", action=[2.0, 0, 0, 0, 0, 0, 0])


POSES = (Se3Pose(Vec3(-0.15, 0.2, 0.35), DOWN), Se3Pose(Vec3(0.3, -0.25, 0.35), DOWN))


def in_branches(cell, arms):
    """A fresh episode in which each of these arms moves in a branch of its own: how long it took, and where all is."""
    cell.cell.reset(cell.cell.sample(0))
    nodes = {
        f"arm{arm}": {"type": "tool", "tool": "robot_control.GoToPoseArm", "inputs": {"arm_id": arm, "pose": pose}}
        for arm, pose in enumerate(map(to_plain, POSES))
        if arm in arms
    }
    edges = [("START", n) for n in nodes] + [(n, "done") for n in nodes]
    graph = compile_fake(fake_workflow(nodes, edges), cell.tools["robot_control.GoToPoseArm"])
    result = run_graph(graph, RunSetup(cell=cell.cell, task=cell.task, lockstep=True))
    assert result.status == "success", result.error
    return cell.cell.time, [arm.state().joints.positions.tobytes() for arm in cell.cell.arms]


def test_arms_in_two_branches_take_as_long_as_the_longer_one_and_the_same_every_time(cell):
    alone = [in_branches(cell, [arm])[0] for arm in (0, 1)]
    first = in_branches(cell, [0, 1])
    assert max(alone) - 0.05 < first[0] < max(alone) + 0.2 < sum(alone)
    stop = threading.Event()

    def spin():
        while not stop.is_set():
            sum(range(1000))

    spinning = [threading.Thread(target=spin) for _ in range(2)]
    for thread in spinning:
        thread.start()
    try:
        assert all(in_branches(cell, [0, 1]) == first for _ in range(3))
    finally:
        stop.set()
        for thread in spinning:
            thread.join()
