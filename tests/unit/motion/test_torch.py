import numpy as np
import pytest

from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Se3Pose, Vec3
from gap_runtime.plugins import load_registry


@pytest.fixture
def solve(cell):
    registry = load_registry(("gap_motion",), entry_points=False)
    registry.choose("pyroki.SolveIK", "pytorch-kinematics")
    return lambda **inputs: registry.tool("pyroki.SolveIK")(cell.context, **inputs)


def test_the_other_provider_reaches_the_same_pose(cell, solve, arm):
    p = cell.arm.state().ee_pose
    goal = Se3Pose(Vec3(p.position.x + 0.05, p.position.y, p.position.z - 0.1), p.rotation)
    q = solve(target_pose=goal).joint_config.positions
    np.testing.assert_allclose(arm.tcp_poses(q, cell.arm.base_pose.matrix)[0], goal.matrix, atol=1e-3)


def test_and_says_when_there_is_none(cell, solve):
    with pytest.raises(PlanningError) as error:
        solve(target_pose=Se3Pose(Vec3(3.0, 0.0, 0.0), cell.arm.state().ee_pose.rotation))
    assert error.value.code == "unreachable"
