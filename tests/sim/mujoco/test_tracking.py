"""Fast lines end where they should: servos that are fed the arm's inertia neither lag behind nor overshoot."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
REGISTRY = load_registry(("gap_robots", "gap_motion"), entry_points=False)
GOAL = np.array([-0.15, -0.05, 0.25])
OVERSHOOT, LAG = 0.0005, 0.002  # m past the end, rad behind the set-point


@pytest.mark.parametrize("lean", [0, 30, -30])
@pytest.mark.parametrize("robot", ["panda", "ur5e"])
def test_a_fast_line_does_not_overshoot(cell_of, robot, lean):
    world, seen = cell_of(robot), []
    controller = world.arms[0].controller
    context = SimpleNamespace(
        cell=world, task=world.task, state={}, seed=0, robot=lambda arm_id=0: world.arms[0].spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
    )  # fmt: skip
    turn = Rotation.from_euler("x", 180, degrees=True) * Rotation.from_euler("y", lean, degrees=True)
    approach, rotation = turn.as_matrix()[:, 2], Quaternion.of(turn)
    before = Se3Pose(Vec3.of(GOAL - 0.2 * approach), rotation)
    REGISTRY.tool("robot_control.GoToPose")(context, pose=before)
    world._physics.observers.append(
        lambda: seen.append(
            (controller.tcp().position.array - GOAL, np.abs(controller.positions - controller.applied.positions).max())
        )
    )
    REGISTRY.tool("robot_control.GoToPoseCartesian")(context, pose=Se3Pose(Vec3.of(GOAL), rotation))
    world.wait(0.2)
    world._physics.observers.clear()
    off, lags = np.array([p for p, _ in seen]), [lag for _, lag in seen]
    assert (off @ approach).max() < OVERSHOOT and np.linalg.norm(off[-1]) < OVERSHOOT
    assert max(lags) < LAG
    assert np.abs(np.diff(off @ approach)).max() / world._scene.model.opt.timestep > 0.5  # m/s: it was fast
