import numpy as np
import pytest

from gap_motion.arguments import ArmModel
from gap_motion.timing.limits import check_trajectory_limits, workspace_excess
from gap_motion.timing.timing import point_to_point
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Trajectory


@pytest.fixture
def planned(cell):
    here = ArmModel(cell.arm)
    goal = here.joints()
    goal[0] += 0.3
    return here, point_to_point(here.chain, np.stack([here.joints(), goal]))


def why(here, trajectory, cell):
    with pytest.raises(MotionError) as error:
        check_trajectory_limits(here, trajectory, cell.context.task, here.joints())
    assert error.value.code == "refused"
    return error.value.detail["why"]


def test_a_planned_motion_passes(planned, cell):
    here, trajectory = planned
    check_trajectory_limits(here, trajectory, cell.context.task, here.joints())


def test_not_a_number_is_refused(planned, cell):
    here, t = planned
    q = t.positions.copy()
    q[3, 1] = np.nan
    assert why(here, Trajectory(t.times, q), cell) == "not_finite"


def test_starting_elsewhere_is_refused(planned, cell):
    here, t = planned
    assert why(here, Trajectory(t.times, t.positions + 0.1), cell) == "start"


def test_leaving_a_joint_limit_is_refused(planned, cell, spec):
    here, t = planned
    ramp = np.linspace(0, 1, len(t.times))[:, None]
    q = t.positions + ramp * np.eye(spec.dof)[2] * (spec.limits[2].upper - t.positions[0, 2] + 0.1)
    assert why(here, Trajectory(t.times, q), cell) == "limits"


@pytest.mark.parametrize("faster", [1.1, 3.0])
def test_going_too_fast_is_refused(planned, cell, faster):
    here, t = planned
    assert why(here, Trajectory(t.times / faster, t.positions), cell) == "rate"


def test_leaving_the_workspace_is_refused_with_the_moment(planned, cell):
    here, t = planned
    p = here.tcp(t.positions[0])[0, :3, 3]
    cell.context.task.environment.workspace = (tuple(p - 0.05), tuple(p + 0.05))
    assert why(here, t, cell) == "workspace"


def test_coming_back_into_the_workspace_is_allowed(planned, cell):
    here, t = planned
    end = here.tcp(t.positions[-1])[0, :3, 3]
    cell.context.task.environment.workspace = (tuple(end - 0.02), tuple(end + 0.02))
    excess = workspace_excess(here, t.positions, cell.context.task)
    assert excess[0] > 0 and excess[-1] == 0
    check_trajectory_limits(here, t, cell.context.task, here.joints())
