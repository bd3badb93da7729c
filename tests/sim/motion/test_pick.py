"""The motion tools move the simulated arm: a pick and a place by known poses, from home to home."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.task import load_task
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
DOWN = Quaternion(0.0, 1.0, 0.0, 0.0)
LONGEST = 5.5  # s of world time for a pick and place, home to home


@pytest.fixture(scope="module")
def cell():
    registry = load_registry(entry_points=False)
    task = load_task(Path(__file__).parents[3] / "tasks" / "fulfill-grocery")
    robots = {r.model: registry.robot(r.model) for r in task.robots}
    world = registry.cells["mujoco"].value(task, "alphabet_soup", robots)
    context = SimpleNamespace(
        cell=world, task=task, state={}, seed=0, robot=lambda arm_id=0: world.arms[arm_id].spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
        renderer=registry.renderer,
    )  # fmt: skip
    yield SimpleNamespace(cell=world, call=lambda name, **inputs: registry.tool(name)(context, **inputs))
    world.close()


def test_a_can_goes_into_the_basket(cell):
    world, call = cell.cell, cell.call
    world.reset(world.sample(1))
    start = world.snapshot()
    can, basket = start.bodies["alphabet_soup"].box.center, start.bodies["basket"].box.center
    began = world.time
    grasp = Se3Pose(Vec3(can.x, can.y, can.z), DOWN)
    above = Se3Pose(Vec3(basket.x, basket.y, 0.3), DOWN)
    call("robot_control.GoToPose", pose=grasp, z_approach=0.1)
    assert 0.05 < call("gripper.Close").width < 0.07
    call("robot_control.GoToPoseCartesian", pose=Se3Pose(Vec3(can.x, can.y, can.z + 0.2), DOWN))
    call("robot_control.GoToPose", pose=above)
    call("robot_control.GoToPoseCartesian", pose=Se3Pose(Vec3(basket.x, basket.y, 0.22), DOWN))
    call("gripper.Open")
    call("robot_control.GoToPoseCartesian", pose=above)
    call("robot_control.GoHome")
    assert world.time - began < LONGEST
    end = world.snapshot()
    assert end.body("alphabet_soup").is_in(end.body("basket"))
    np.testing.assert_allclose(world.arms[0].state().joints.positions, world.arms[0].spec.home, atol=0.01)


def test_pushing_into_the_floor_is_reported_as_contact_and_the_arm_can_go_on(cell):
    cell.cell.reset(cell.cell.sample(1))
    with pytest.raises(MotionError) as error:
        cell.call("robot_control.GoToPoseCartesian", pose=Se3Pose(Vec3(-0.15, 0.0, 0.0), DOWN), lin_vel_norm=0.1)
    assert error.value.code in {"contact", "stalled", "tracking"}
    cell.call("robot_control.GoHome")
