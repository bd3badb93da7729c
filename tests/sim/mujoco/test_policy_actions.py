"""Actions of a policy flow into one another: the arm does not stop between them, and ends where they add up to."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_motion.arguments import STEP
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import ActionChunk
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
REGISTRY = load_registry(("gap_robots", "gap_motion"), entry_points=False)


@pytest.fixture(params=["panda", "ur5e"])
def cell(request, cell_of):
    """One robot at home, its set-points as they are given, and `act(*action)`."""
    world, seen = cell_of(request.param), []
    context = SimpleNamespace(
        cell=world, task=world.task, state={}, seed=0, robot=lambda arm_id=0: world.arms[0].spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
    )  # fmt: skip
    controller = world.arms[0].controller
    world._physics.observers.append(lambda: seen.append((controller.applied.positions, controller.velocities)))
    yield SimpleNamespace(
        cell=world, arm=world.arms[0], seen=seen,
        act=lambda *action: REGISTRY.tool("robot_control.ApplyPolicyAction")(context, action=list(action)),
        follow=lambda chunk: REGISTRY.tool("robot_control.ExecuteActionChunk")(context, chunk=chunk),
    )  # fmt: skip
    world._physics.observers.clear()


def test_small_actions_flow_and_add_up(cell):
    action, count = (0.04, 0.06, -0.05, 0.0, 0.0, 0.02, 0.0), 20
    before = cell.arm.state().ee_pose
    for _ in range(count):
        cell.act(*action)
    assert cell.cell.time == pytest.approx(count * STEP)
    speeds = np.linalg.norm([v for _, v in cell.seen], axis=1)
    moving = speeds[2 * len(speeds) // count :]  # once two actions have brought it up to speed
    assert moving.min() > 0.5 * moving.max()
    cell.arm.finish()
    after = cell.arm.state()
    np.testing.assert_allclose(
        after.ee_pose.position.array - before.position.array, count * 0.05 * np.array(action[:3]), atol=1e-3
    )
    turned = (after.ee_pose.rotation.rotation * before.rotation.rotation.inv()).as_rotvec()
    np.testing.assert_allclose(turned, [0, 0, count * 0.5 * 0.02], atol=2e-3)


def test_chunks_are_followed_without_a_stop_between(cell):
    home = np.array(cell.arm.state().joints.positions)
    targets = home + np.linspace(0.01, 0.2, 20)[:, None]
    for part in (targets[:10], targets[10:]):
        cell.follow(ActionChunk(20.0, joints=part))
    assert cell.cell.time == pytest.approx(len(targets) / 20.0)
    speeds = np.linalg.norm([v for _, v in cell.seen], axis=1)
    moving = speeds[len(speeds) // 5 :]
    assert moving.min() > 0.5 * moving.max()
    cell.arm.finish()
    np.testing.assert_allclose(cell.arm.state().joints.positions, targets[-1], atol=5e-3)


def test_the_largest_actions_stay_inside_every_limit(cell):
    for k in range(12):
        cell.act(*([0, 1.0, 0] if k < 6 else [0, -1.0, 0]), 0, 0, 0, 1.0 if k % 2 else -1.0)
    cell.arm.finish()
    rows, step = np.array([q for q, _ in cell.seen]), cell.cell._scene.model.opt.timestep
    for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
        limits = [getattr(x, name) for x in cell.arm.spec.limits]
        assert (np.abs(np.diff(rows, order, axis=0)).max(axis=0) / step**order <= np.array(limits) * 1.02).all(), name
    measured = np.abs([v for _, v in cell.seen]).max(axis=0)
    assert (measured <= [x.velocity for x in cell.arm.spec.limits]).all()


def test_jaws_move_while_the_arm_does(cell):
    for _ in range(4):
        cell.act(0.1, 0, 0, 0, 0, 0, 1.0)
    assert cell.cell.time == pytest.approx(4 * STEP)
    assert 0 < cell.arm.state().gripper.width < cell.arm.spec.gripper.max_width - 0.01


def test_a_policy_that_runs_away_from_the_arm_is_refused(cell):
    with pytest.raises(MotionError) as error:
        for k in range(40):
            cell.act(0, 0, 0, 0, 0, 1.0 if k < 5 else -1.0, 0)
            cell.act(0, 0, 0, 0, 0, 1.0 if k < 5 else -1.0, 0)
    assert error.value.code == "refused" and error.value.detail["why"] == "rate"
    cell.arm.finish()


def test_a_command_that_comes_between_starts_a_new_stream(cell):
    cell.act(0, 0.5, 0, 0, 0, 0, 0)
    cell.arm.stop()
    cell.arm.finish()
    here = cell.arm.state().ee_pose.position.array
    cell.act(0, 0, 0.2, 0, 0, 0, 0)
    cell.arm.finish()
    np.testing.assert_allclose(cell.arm.state().ee_pose.position.array - here, [0, 0, 0.01], atol=1e-3)
