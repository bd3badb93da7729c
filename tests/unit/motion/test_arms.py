from types import SimpleNamespace

import numpy as np
import pytest

from gap_motion.arguments import ArmModel
from gap_motion.planning.multi_arm import in_step, refuse_meeting
from gap_motion.planning.planning_scene import PlanningScene
from gap_motion.timing.timing import MotionLimits, point_to_point
from gap_runtime.contracts.arm import Setpoint
from gap_runtime.contracts.failures import BadRequestError, MotionError, PlanningError
from gap_runtime.contracts.types import ActionChunk, JointState, Quaternion, Se3Pose, Vec3
from tests.unit.motion.conftest import ALONE, IdealArm

OPPOSITE = Se3Pose(Vec3(0.9, 0.1, 0.0), Quaternion(0.2955202066613396, 0.0, 0.0, -0.9553364891256060))

NEAR = Se3Pose(Vec3(0.0, 0.0, 0.4), Quaternion(0.0, 1.0, 0.0, 0.0))


@pytest.fixture
def pair(cell, spec):
    """Two arms facing each other, in a world that moves them together."""
    arms = [cell.arm, IdealArm(spec, OPPOSITE)]
    moved = []

    def execute(motions, *, tolerance=0.01):
        moved.append(motions)
        for arm_id, motion in motions.items():
            arms[arm_id].execute(motion)

    cell.context.cell = SimpleNamespace(arms=arms, execute=execute)
    cell.context.task.robots = [SimpleNamespace(home=None)] * 2
    return SimpleNamespace(arms=arms, moved=moved, call=cell.call, context=cell.context)


def test_motions_in_step_end_together_inside_the_limits(spec, arm):
    home = np.array(spec.home)
    short, long = (point_to_point(arm, np.stack([home, home + d])) for d in (0.1, 0.6))
    a, b = in_step([short, long])
    np.testing.assert_array_equal(a.times, b.times)
    np.testing.assert_allclose(a.positions[[0, -1]], short.positions[[0, -1]], atol=1e-9)
    limits = MotionLimits.of(spec, 1.0, 1.0)
    assert (np.abs(a.velocities) <= limits.velocity).all() and (np.abs(b.velocities) <= limits.velocity).all()


def test_both_arms_get_one_command(pair, spec):
    goals = [JointState(np.array(spec.home) + d) for d in (0.1, -0.1)]
    pair.call("robot_control.MoveToJointsBoth", joints_arm0=goals[0], joints_arm1=goals[1])
    assert len(pair.moved) == 1 and set(pair.moved[0]) == {0, 1}
    for arm, goal in zip(pair.arms, goals, strict=True):
        np.testing.assert_allclose(arm.q, goal.positions)


def test_one_arm_of_two_is_named(pair):
    goal = pair.call("robot_control.GetEEPose", arm_id=1).pose
    goal = Se3Pose(Vec3(goal.position.x, goal.position.y, goal.position.z - 0.1), goal.rotation)
    pair.call("robot_control.GoToPoseArm", arm_id=1, pose=goal)
    assert pair.arms[0].executed == [] and len(pair.arms[1].executed) == 1
    np.testing.assert_allclose(pair.arms[1].state().ee_pose.matrix, goal.matrix, atol=1e-3)


def test_arms_that_would_meet_are_refused(pair):
    ends = [ArmModel(arm).tcp(arm.q)[0][:3, 3] for arm in pair.arms]
    middle = Vec3.of((ends[0] + ends[1]) / 2)
    rotation = pair.arms[0].state().ee_pose.rotation
    with pytest.raises((MotionError, PlanningError)) as error:
        pose = Se3Pose(middle, rotation)
        pair.call("robot_control.GoToPoseBoth", pose_arm0=pose, pose_arm1=pose)
    assert error.value.code in {"refused", "unreachable", "limits"} and pair.moved == []


@pytest.fixture
def beside(pair):
    """The second arm stands 0.45 m to the left of the first, which turns towards it by its first joint."""
    left = np.eye(4)
    left[1, 3] = 0.45
    pair.arms[1].base_pose = Se3Pose.of(pair.arms[0].base_pose.matrix @ left)
    pair.turned = lambda angle: np.array(pair.arms[0].spec.home) + angle * np.eye(pair.arms[0].spec.dof)[0]
    pair.go = lambda angle: pair.call("robot_control.MoveToJoints", joint_config=JointState(pair.turned(angle)))
    return pair


def test_one_arm_is_not_sent_through_another_that_stands(beside):
    with pytest.raises(MotionError) as error:
        beside.go(np.pi / 2)
    assert error.value.code == "refused" and error.value.detail["why"] == "arms_meet"
    assert beside.arms[0].executed == []
    beside.go(-np.pi / 2)
    np.testing.assert_allclose(beside.arms[0].q, beside.turned(-np.pi / 2))


def test_where_another_arm_is_going_counts_too(beside):
    arm = beside.arms[1]
    beside.go(0.05)
    arm.setpoint = lambda: Setpoint(arm.q, arm.q * 0, arm.q * 0, arm.q - np.pi / 2 * np.eye(arm.spec.dof)[0])
    with pytest.raises(MotionError) as error:
        beside.go(0.1)
    assert error.value.detail["why"] == "arms_meet"


def test_a_planner_sees_another_arm_where_it_is_and_where_it_is_going(beside):
    arm = beside.arms[1]
    standing = PlanningScene.of(beside.context, ALONE).world
    assert all(name.startswith("arm:1:") for name in standing.names)
    arm.setpoint = lambda: Setpoint(arm.q, arm.q * 0, arm.q * 0, arm.q - np.pi / 2 * np.eye(arm.spec.dof)[0])
    going = PlanningScene.of(beside.context, ALONE).world
    assert len(going.names) == 2 * len(standing.names) == 2 * len(arm.spec.spheres)


def test_an_arm_too_near_to_another_may_go_away_from_it(beside):
    cells = [ArmModel(arm, i) for i, arm in enumerate(beside.arms)]

    def too_near(angle):
        still = [
            point_to_point(c.chain, np.stack([q, q]))
            for c, q in zip(cells, (beside.turned(angle), beside.arms[1].q), strict=True)
        ]
        try:
            refuse_meeting(cells, still)
        except MotionError:
            return True
        return False

    angle = next(a for a in np.linspace(0.0, np.pi / 2, 300) if too_near(a))
    beside.arms[0].q = beside.turned(angle)
    with pytest.raises(MotionError):
        beside.go(angle + 0.1)
    beside.go(0.0)


def test_a_world_that_moves_one_arm_at_a_time_says_so(pair, spec):
    pair.context.cell = SimpleNamespace(arms=pair.arms)
    home = JointState(np.array(spec.home))
    with pytest.raises(MotionError) as error:
        pair.call("robot_control.MoveToJointsBoth", joints_arm0=home, joints_arm1=home)
    assert error.value.code == "unsupported"


def test_a_policy_action_moves_by_its_share_of_the_scale(cell):
    before = cell.call("robot_control.GetEEPose").pose
    cell.call("robot_control.ApplyPolicyAction", action=[0.0, 0.0, -1.0, 0.0, 0.0, 0.5, -1.0])
    after = cell.call("robot_control.GetEEPose").pose
    np.testing.assert_allclose(after.position.array - before.position.array, [0, 0, -0.05], atol=1e-3)
    turned = (after.rotation.rotation * before.rotation.rotation.inv()).as_rotvec()
    np.testing.assert_allclose(turned, [0, 0, 0.25], atol=1e-3)
    assert cell.arm.gripper.width == cell.arm.spec.gripper.max_width


def test_the_jaws_move_only_when_the_policy_changes_its_mind(cell, monkeypatch):
    calls = []
    monkeypatch.setattr(cell.arm.gripper, "set_width", lambda width, **_: calls.append(width))
    for grip in (1.0, 1.0, 0.0, -1.0):
        cell.call("robot_control.ApplyPolicyAction", action=[0, 0, 0, 0, 0, 0, grip])
    assert calls == [0.0, cell.arm.spec.gripper.max_width]


@pytest.mark.parametrize(
    ("code", "action"), [("shape", [0.0] * 6), ("range", [1.5, *[0.0] * 6]), ("not_finite", [float("nan"), *[0.0] * 6])]
)
def test_actions_outside_the_contract_are_refused(cell, code, action):
    with pytest.raises(BadRequestError) as error:
        cell.call("robot_control.ApplyPolicyAction", action=action)
    assert error.value.code == code and cell.arm.executed == []


@pytest.mark.parametrize("form", ["joints", "poses"])
def test_a_chunk_is_followed_to_its_last_target(cell, form):
    goal = np.array(cell.arm.spec.home) + 0.02 * np.arange(1, 5)[:, None]
    here = ArmModel(cell.arm)
    poses = tuple(Se3Pose.of(T) for T in here.chain.tcp_poses(goal, cell.arm.base_pose.matrix))
    given = {"joints": goal} if form == "joints" else {"poses": poses}
    cell.call("robot_control.ExecuteActionChunk", chunk=ActionChunk(20.0, gripper=np.array([1, 1, 0.5, 0.5]), **given))
    assert len(cell.arm.executed) == len(goal)
    assert cell.arm.gripper.width == pytest.approx(cell.arm.spec.gripper.max_width / 2)
    reached = here.chain.tcp_poses(cell.arm.q, cell.arm.base_pose.matrix)[0]
    np.testing.assert_allclose(reached, poses[-1].matrix, atol=2e-3)


@pytest.mark.parametrize(
    ("code", "change"),
    [
        ("range", {"rate": 0.0}),
        ("range", {"rate": 1e6}),
        ("range", {"gripper": np.array([0.5])}),
        ("range", {"gripper": np.array([0.5, 1.5])}),
        ("shape", {"poses": (NEAR,)}),
        ("joint_count", {"joints": np.zeros((2, 3))}),
        ("limits", {"joints": np.full((2, 7), 9.0)}),
    ],
)
def test_a_chunk_outside_the_contract_is_refused(cell, spec, code, change):
    home = np.tile(spec.home, (2, 1))
    joints = change.get("joints", home)
    given = {"rate": 10.0, **change, "joints": joints[:, : spec.dof] if joints.shape[1] == 7 else joints}
    with pytest.raises(BadRequestError) as error:
        cell.call("robot_control.ExecuteActionChunk", chunk=ActionChunk(**given))
    assert error.value.code == code and cell.arm.executed == []


def test_a_bimanual_pair_stands_clear_of_each_other_at_home(robot):
    from gap_robots.panda import SIDE_BY_SIDE

    spec = robot("panda-bimanual")
    level = Quaternion(1.0, 0.0, 0.0, 0.0)
    arms = [IdealArm(spec, Se3Pose(Vec3(0.0, s * SIDE_BY_SIDE / 2, 0.0), level)) for s in (-1, 1)]
    cells = [ArmModel(arm, i) for i, arm in enumerate(arms)]
    still = [point_to_point(cell.chain, np.stack([cell.arm.q, cell.arm.q])) for cell in cells]
    refuse_meeting(cells, in_step(still))
    near = [IdealArm(spec, Se3Pose(Vec3(0.0, s * 0.05, 0.0), level)) for s in (-1, 1)]
    with pytest.raises(MotionError):
        refuse_meeting([ArmModel(arm, i) for i, arm in enumerate(near)], in_step(still))


def test_all_arms_go_home_together(pair, spec):
    for arm in pair.arms:
        arm.q = np.array(spec.home) + 0.1
    pair.call("robot_control.GoHome")
    assert len(pair.moved) == 1
    for arm in pair.arms:
        np.testing.assert_allclose(arm.q, spec.home, atol=1e-9)
