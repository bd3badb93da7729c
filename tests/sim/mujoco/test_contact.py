"""An arm that meets something fixed says so, stops pressing, and can go home."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_control.contact_reaction import RETRACT_DISTANCE
from gap_mujoco.simulator import MujocoSimulator
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.task import Support
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
REGISTRY = load_registry(("gap_robots", "gap_motion"), entry_points=False)
DOWN = Quaternion(0.0, 1.0, 0.0, 0.0)
TOP = 0.22  # m: of a slab that is fixed in the cell, and that no motion here asks about
YIELDING = 0.6  # s: longest time from the contact to rest


@pytest.fixture(scope="module", params=["panda", "ur5e"])
def made(request, task):
    robot = task.robots[0].model_copy(update={"model": request.param, "home": None})
    slab = Support(z=TOP, center=(-0.05, 0.0), half_size=(0.15, 0.15))
    supports = {**task.environment.supports, "slab": slab}
    cell = task.model_copy(
        update={"robots": [robot], "environment": task.environment.model_copy(update={"supports": supports})}
    )
    world = MujocoSimulator(cell, "milk", {request.param: REGISTRY.robot(request.param)})
    world.task = cell
    yield world
    world.close()


@pytest.fixture
def cell(made):
    """The world, its only controller, the share of the contact torque at every step, and `call(tool, **inputs)`."""
    context = SimpleNamespace(
        cell=made, task=made.task, state={}, seed=0, robot=lambda arm_id=0: made.arms[0].spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
    )  # fmt: skip
    made.reset(made.sample(1))
    controller, shares = made.arms[0].controller, []
    made._physics.observers.append(
        lambda: shares.append((controller.external_torque / controller.contact_torque).max())
    )
    yield SimpleNamespace(
        cell=made, arm=made.arms[0], shares=shares, controller=controller,
        call=lambda name, **inputs: REGISTRY.tool(name)(context, **inputs),
    )  # fmt: skip
    made._physics.observers.clear()


def into_the_slab(cell, speed):
    with pytest.raises(MotionError) as stop:
        cell.call(
            "robot_control.GoToPoseCartesian", pose=Se3Pose(Vec3(-0.1, 0.0, TOP - 0.12), DOWN), lin_vel_norm=speed
        )
    assert stop.value.code == "contact"


@pytest.mark.parametrize("speed", [0.1, 1.0])
def test_an_arm_that_met_a_slab_lets_go_and_goes_home(cell, speed):
    into_the_slab(cell, speed)
    met, here = next(i for i, share in enumerate(cell.shares) if share > 1), cell.arm.state().ee_pose.position.z
    assert (len(cell.shares) - met) * cell.cell._scene.model.opt.timestep < YIELDING
    cell.cell.wait(0.3)
    rest = cell.arm.state()
    assert cell.shares[-1] < 1 and np.abs(rest.joints.velocities).max() < 0.01
    assert abs(rest.ee_pose.position.z - here) < 2 * RETRACT_DISTANCE
    cell.call("robot_control.GoHome")
    np.testing.assert_allclose(cell.arm.state().joints.positions, cell.arm.spec.home, atol=0.01)


def test_an_arm_that_nobody_waits_for_lets_go_too(cell):
    p = cell.arm.state().ee_pose.position
    cell.call("robot_control.GoToPose", pose=Se3Pose(Vec3(p.x + 0.05, p.y, TOP - 0.12), DOWN), nonblocking=True)
    assert cell.cell.time == 0
    cell.cell.wait(2.0)
    assert max(cell.shares) > 1 and cell.shares[-1] < 1
    with pytest.raises(MotionError) as stop:
        cell.call("robot_control.GoHome")
    assert stop.value.code == "contact" and stop.value.detail["started_s"] == 0
    cell.call("robot_control.GoHome")
    np.testing.assert_allclose(cell.arm.state().joints.positions, cell.arm.spec.home, atol=0.01)
