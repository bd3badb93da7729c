import numpy as np
import pytest

from gap_runtime.contracts.failures import BadRequestError, MotionError, PlanningError
from gap_runtime.contracts.types import JointState, Se3Pose, Trajectory, Vec3


def here(cell):
    return cell.call("robot_control.GetEEPose").pose


def moved(pose, x=0.0, y=0.0, z=0.0):
    p = pose.position
    return Se3Pose(Vec3(p.x + x, p.y + y, p.z + z), pose.rotation)


def code(error, cell, name, **inputs):
    with pytest.raises(error) as caught:
        cell.call(name, **inputs)
    assert cell.arm.executed == [], "nothing may move on a refused request"
    return caught.value.code


def assert_at(cell, pose, offset=None):
    np.testing.assert_allclose(here(cell).matrix, pose.matrix, atol=1e-3)


@pytest.mark.parametrize("name", ["robot_control.GoToPose", "robot_control.GoToPoseCartesian"])
def test_the_tcp_arrives(cell, name):
    goal = moved(here(cell), 0.05, -0.1, -0.15)
    cell.call(name, pose=goal)
    assert_at(cell, goal)


def test_an_approach_arrives_in_one_motion(cell):
    goal = moved(here(cell), 0.05, -0.1, -0.15)
    cell.call("robot_control.GoToPose", pose=goal, z_approach=0.08)
    assert_at(cell, goal)
    assert len(cell.arm.executed) == 1


def test_a_tcp_offset_moves_the_flange_not_the_pose(cell, spec):
    goal = moved(here(cell), z=-0.1)
    depth = spec.tcp_offset_position[2]
    cell.call("robot_control.GoToPose", pose=goal, tcp_offset=Vec3(0, 0, -depth - 0.02))
    assert_at(cell, moved(goal, z=0.02))


def test_home_is_the_tasks_when_it_has_one(cell, spec):
    home = tuple(q + 0.1 for q in spec.home)
    cell.context.task.robots[0].home = home
    cell.call("robot_control.GoHome")
    np.testing.assert_allclose(cell.arm.q, home)


def test_joints_go_where_they_are_told(cell, spec):
    goal = np.array(spec.home) - 0.2
    cell.call("robot_control.MoveToJoints", joint_config=JointState(goal))
    np.testing.assert_allclose(cell.arm.q, goal)


def test_ik_and_a_joint_move_bring_the_tcp_there(cell):
    goal = moved(here(cell), 0.0, 0.1, -0.1)
    solution = cell.call("pyroki.SolveIK", target_pose=goal)
    assert solution.success
    cell.call("robot_control.MoveToJoints", joint_config=solution.joint_config)
    assert_at(cell, goal)


def test_a_planned_line_can_be_executed(cell):
    start, goal = here(cell), moved(here(cell), z=-0.2)
    line = cell.call("pyroki.PlanLinear", start_pose=start, end_pose=goal)
    assert line.success and line.trajectory.times[1] == pytest.approx(0.02, rel=0.2)
    cell.call("robot_control.ExecuteJointTrajectory", trajectory=line.trajectory, subsample=2)
    assert_at(cell, goal)


def test_the_gripper_opens_and_closes(cell, spec):
    assert cell.call("gripper.Close").width == 0.0
    assert cell.call("gripper.Open").width == spec.gripper.max_width
    assert cell.call("gripper.GetPosition").fraction == 1.0
    assert cell.call("gripper.GetPose").pose == here(cell)


def test_requests_outside_the_contract_are_refused(cell, spec):
    pose = here(cell)
    nan = Se3Pose(Vec3(float("nan"), 0, 0), pose.rotation)
    joints = JointState(np.zeros(spec.dof - 1))
    assert code(BadRequestError, cell, "robot_control.GoToPose", pose=nan) == "not_finite"
    assert code(BadRequestError, cell, "robot_control.GoToPoseCartesian", pose=pose, lin_vel_norm=0.0) == "range"
    assert code(BadRequestError, cell, "robot_control.MoveToJoints", joint_config=joints) == "joint_count"
    assert code(BadRequestError, cell, "pyroki.SolveIK", target_pose=pose, target_link_name="elbo") == "unknown_link"
    assert code(BadRequestError, cell, "robot_control.GetEEPose", arm_id=1) == "unknown_arm"
    empty = Trajectory(np.zeros(0), np.zeros((0, spec.dof)))
    assert code(BadRequestError, cell, "robot_control.ExecuteJointTrajectory", trajectory=empty) == "empty"


def test_what_cannot_be_reached_is_said_before_anything_moves(cell):
    far = moved(here(cell), 2.0)
    assert code(PlanningError, cell, "robot_control.GoToPose", pose=far) == "unreachable"
    assert code(PlanningError, cell, "pyroki.SolveIK", target_pose=far) == "unreachable"


def test_a_motion_longer_than_its_steps_is_not_begun(cell):
    goal = moved(here(cell), 0.1, 0.1, -0.2)
    assert code(PlanningError, cell, "robot_control.GoToPose", pose=goal, max_steps=2) == "budget"
    assert code(PlanningError, cell, "robot_control.GoToPoseCartesian", pose=goal, timeout_s=0.05) == "budget"


def test_leaving_the_workspace_is_refused_whole(cell):
    p = here(cell).position
    cell.context.task.environment.workspace = ((p.x - 0.1, p.y - 0.1, p.z - 0.1), (p.x + 0.1, p.y + 0.1, p.z + 0.1))
    goal = moved(here(cell), z=-0.2)
    assert code(MotionError, cell, "robot_control.GoToPoseCartesian", pose=goal) == "refused"
