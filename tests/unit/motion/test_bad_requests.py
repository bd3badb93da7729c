"""Every motion tool, asked for what cannot be: a typed error with its code, on both arms, and nothing moves."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gap_runtime.contracts.encoding.codec import from_plain, to_plain
from gap_runtime.contracts.failures import BadRequestError, ToolError
from gap_runtime.contracts.types import (
    ActionChunk,
    JointState,
    Obstacle,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Trajectory,
    Vec3,
    WorldConfig,
)  # fmt: skip
from tests.unit.motion.conftest import REGISTRY, IdealArm

NAN = float("nan")
LEVEL = Quaternion(1.0, 0.0, 0.0, 0.0)
OPPOSITE = Se3Pose(Vec3(0.9, 0.1, 0.0), Quaternion(0.2955202066613396, 0.0, 0.0, -0.9553364891256060))
SERVICES = ("robot_control.", "gripper.", "curobo.", "pyroki.")
TOOLS = {
    f"{name}@{provider}": tool
    for name, by in sorted(REGISTRY.providers.items())
    for provider, tool in sorted(by.items())
    if name.startswith(SERVICES) and provider in ("embedded", "pytorch-kinematics")
}


@pytest.fixture(params=["panda", "ur5e"])
def asked(request, robot):
    """`ask(tool, **changes)`: the code of the answer to a good request with some inputs changed ("" for success)."""
    spec = robot(request.param)
    arms = [IdealArm(spec), IdealArm(spec, OPPOSITE)]
    world = SimpleNamespace(arms=arms, wait=lambda seconds: None, execute=lambda motions, tolerance=0.01: None)
    environment = SimpleNamespace(workspace=((-1.5, -1.5, -0.2), (1.5, 1.5, 1.5)))
    task = SimpleNamespace(environment=environment, robots=[SimpleNamespace(home=None)] * 2)
    context = SimpleNamespace(
        cell=world, task=task, state={}, seed=0, robot=lambda arm_id=0: spec,
        shared=lambda key, make: make(), raise_if_cancelled=lambda: None,
    )  # fmt: skip
    good = Good(arms)

    def ask(tool, **changes):
        inputs = {p.name: good.value(p) for p in tool.spec.inputs if p.required} | changes
        try:
            return told(tool(context, **inputs))
        except ToolError as error:
            assert error.message and not any(arm.executed for arm in arms)
            return error.code

    return SimpleNamespace(ask=ask, good=good, spec=spec)


def told(result):
    """The code in a result that tells its failure rather than raising it."""
    reason = getattr(result, "failure_reason", "")
    return reason.split(":")[0]


class Good:
    """Inputs that a tool accepts: from where the arm stands, 6 cm down."""

    def __init__(self, arms):
        self.here, self.there = arms[0].state().ee_pose, arms[1].state().ee_pose
        self.joints = JointState(arms[0].q)
        still = np.repeat(arms[0].q[None], 3, axis=0)
        self.trajectory = Trajectory(np.array([0.0, 0.1, 0.2]), still, np.zeros_like(still))
        self.down = Se3Pose(Vec3(*(self.here.position.array - [0, 0, 0.06])), self.here.rotation)
        self.chunk = ActionChunk(20.0, joints=still)
        self.far_box = obstacle("thing", Se3Pose(Vec3(0.6, 0.6, -1.0), LEVEL), 0.02)

    def value(self, parameter):
        kind, name = str(parameter.type).replace("[world]", ""), parameter.name
        if name == "start_pose":
            return self.here
        if name.endswith("arm1"):
            return self.there if kind == "Se3Pose" else self.joints
        return {
            "Se3Pose": self.down, "Se3Pose[]": [self.down], "JointState": self.joints, "Trajectory": self.trajectory,
            "WorldConfig": WorldConfig((self.far_box,)), "float[]": [0.0] * 7, "string[]": ["z"], "string": "thing",
            "int": 0, "ActionChunk": self.chunk,
        }[kind]  # fmt: skip


def obstacle(name, pose, half, points=None):
    return Obstacle(name, OrientedBoundingBox(pose.position, Vec3(half, half, half), LEVEL), points)


def inputs_of(kind, *, but=()):
    """(tool, input) for every input of a kind."""
    return [
        pytest.param(tool, p.name, id=f"{key}-{p.name}")
        for key, tool in TOOLS.items()
        for p in tool.spec.inputs
        if str(p.type).replace("[world]", "").rstrip("?") == kind and p.name not in but
    ]


@pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)
def test_a_good_request_is_served(asked, tool):
    assert asked.ask(tool) == ""


@pytest.mark.parametrize(("tool", "name"), inputs_of("Se3Pose") + inputs_of("Se3Pose[]"))
class TestPoses:
    def given(self, name, pose):
        return {name: [pose] if name == "grasp_poses" else pose}

    def test_not_a_number(self, asked, tool, name):
        pose = Se3Pose(Vec3(NAN, 0, 0), LEVEL)
        assert asked.ask(tool, **self.given(name, pose)) == "not_finite"

    def test_a_quaternion_that_is_not_unit(self, asked, tool, name):
        parameter = next(p for p in tool.spec.inputs if p.name == name)
        data = to_plain(asked.good.down)
        data["rotation"]["w"] += 1.0
        with pytest.raises(BadRequestError, match="unit norm") as error:
            from_plain([data] if name == "grasp_poses" else data, parameter.type, where=name)
        assert error.value.code == "shape"

    def test_out_of_reach(self, asked, tool, name):
        far = Se3Pose(Vec3(3.0, 0, 0.5), asked.good.here.rotation)
        code = asked.ask(tool, **self.given(name, far))
        if name == "start_pose" and tool.spec.name.startswith("curobo"):
            assert code == "start_mismatch"
        elif tool.spec.name == "curobo.PlanDirectedLinear":
            assert asked.ask(tool, **self.given(name, far), allowed_axes=["x"]) == "unreachable"
        elif tool.spec.name == "curobo.BatchGraspFeasibility":
            assert code == ""  # its answer is that the grasp is not feasible
        else:
            assert code in {"unreachable", "limits"}


@pytest.mark.parametrize("tool", [t for t in TOOLS.values() if any(p.name == "grasp_poses" for p in t.spec.inputs)])
def test_no_grasps_at_all(asked, tool):
    assert asked.ask(tool, grasp_poses=[]) == "empty"


@pytest.mark.parametrize(("tool", "name"), inputs_of("JointState"))
class TestJoints:
    def test_wrong_count(self, asked, tool, name):
        assert asked.ask(tool, **{name: JointState(asked.good.joints.positions[:-1])}) == "joint_count"

    def test_not_a_number(self, asked, tool, name):
        assert asked.ask(tool, **{name: JointState(asked.good.joints.positions * NAN)}) == "not_finite"

    def test_outside_the_limits(self, asked, tool, name):
        assert asked.ask(tool, **{name: JointState(asked.good.joints.positions + 100)}) == "limits"


@pytest.mark.parametrize(("tool", "name"), inputs_of("Trajectory"))
class TestTrajectories:
    def test_wrong_count(self, asked, tool, name):
        t = asked.good.trajectory
        assert asked.ask(tool, **{name: Trajectory(t.times, t.positions[:, 1:])}) == "joint_count"

    def test_not_a_number(self, asked, tool, name):
        t = asked.good.trajectory
        assert asked.ask(tool, **{name: replace(t, positions=t.positions * NAN)}) == "not_finite"
        assert asked.ask(tool, **{name: replace(t, times=t.times * NAN)}) == "not_finite"

    def test_no_points(self, asked, tool, name):
        assert asked.ask(tool, **{name: Trajectory(np.zeros(0), np.zeros((0, asked.spec.dof)))}) == "empty"

    def test_times_that_stand_still(self, asked, tool, name):
        t = asked.good.trajectory
        assert asked.ask(tool, **{name: replace(t, times=t.times * 0)}) == "times"


@pytest.mark.parametrize(("tool", "name"), inputs_of("WorldConfig"))
class TestWorlds:
    def test_not_a_number(self, asked, tool, name):
        bad = obstacle("thing", Se3Pose(Vec3(NAN, 0, 0), LEVEL), 0.02)
        assert asked.ask(tool, **{name: WorldConfig((bad,))}) == "not_finite"
        bad = obstacle("thing", asked.good.down, 0.02, np.full((5, 3), NAN))
        assert asked.ask(tool, **{name: WorldConfig((bad,))}) == "not_finite"

    def test_a_million_points(self, asked, tool, name):
        points = np.random.default_rng(0).uniform((0.5, 0.5, -1.1), (0.7, 0.7, -0.9), (1_000_000, 3))
        config = WorldConfig((obstacle("thing", Se3Pose(Vec3(0.6, 0.6, -1.0), LEVEL), 0.1, points),))
        assert asked.ask(tool, **{name: config}) == ""

    def test_a_start_in_collision(self, asked, tool, name):
        inside = WorldConfig((asked.good.far_box, obstacle("wall", asked.good.here, 0.08)))
        code = asked.ask(tool, **{name: inside})
        assert code == ("" if tool.spec.name == "curobo.BatchGraspFeasibility" else "in_collision")


PLANNERS = [t for t in TOOLS.values() if t.spec.name.startswith("curobo.Plan")]


@pytest.mark.parametrize("tool", PLANNERS, ids=lambda t: t.spec.name)
def test_a_target_inside_the_table(asked, tool):
    table = obstacle("table", Se3Pose(Vec3(*(asked.good.here.position.array - [0, 0, 0.75])), LEVEL), 0.5)
    deep = Se3Pose(Vec3(*(asked.good.here.position.array - [0, 0, 0.32])), asked.good.here.rotation)
    goal = next(n for n in ("grasp_poses", "grasp_pose", "target_pose", "end_pose") if n in named(tool))
    config = WorldConfig((asked.good.far_box, table))
    code = asked.ask(tool, **{goal: [deep] if goal == "grasp_poses" else deep, "world_config": config})
    assert code == "in_collision"


def named(tool):
    return {p.name for p in tool.spec.inputs}


@pytest.mark.parametrize(("tool", "name"), inputs_of("float"))
def test_a_number_that_is_not_one(asked, tool, name):
    assert asked.ask(tool, **{name: NAN}) in {"not_finite", "range", "refused"}


@pytest.mark.parametrize(("tool", "name"), inputs_of("Vec3"))
def test_a_vector_that_is_not_one(asked, tool, name):
    assert asked.ask(tool, **{name: Vec3(NAN, 0, 0)}) in {"not_finite", "range"}


@pytest.mark.parametrize("arm_id", [-1, 2, True])
@pytest.mark.parametrize("tool", [t for t in TOOLS.values() if "arm_id" in named(t)], ids=lambda t: t.spec.name)
def test_an_arm_that_is_not_there(asked, tool, arm_id):
    assert asked.ask(tool, arm_id=arm_id) == "unknown_arm"


@pytest.mark.parametrize("tool", [t for t in TOOLS.values() if "target_link_name" in named(t)])
def test_a_link_that_is_not_there(asked, tool):
    assert asked.ask(tool, target_link_name="elbo") == "unknown_link"


@pytest.mark.parametrize("name", ["ignore_obstacle_names", "object_name"])
def test_an_obstacle_that_is_not_there(asked, name):
    for tool in (t for t in TOOLS.values() if name in named(t)):
        assert asked.ask(tool, **{name: ["ghost"] if name.endswith("s") else "ghost"}) == "unknown_obstacle"


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("robot_control.GoToPose", {"max_steps": 0}),
        ("robot_control.GoToPose", {"z_approach": -0.1}),
        ("robot_control.MoveToJoints", {"max_steps": -1}),
        ("robot_control.ExecuteJointTrajectory", {"subsample": 0}),
        ("robot_control.ApplyPolicyAction", {"action": [0.0] * 6}),
        ("robot_control.ApplyPolicyAction", {"action": [NAN] * 7}),
        ("robot_control.ApplyPolicyAction", {"action": [2.0] * 7}),
        ("gripper.Close", {"settle_steps": -1}),
        ("curobo.SolveIK", {"num_seeds": 0}),
        ("curobo.PlanLinear", {"num_waypoints": 10**9}),
        ("curobo.PlanLinear", {"hold_vec_weight": [1.0]}),
        ("curobo.PlanDirectedLinear", {"allowed_axes": ["w"]}),
        ("curobo.PlanDirectedLinear", {"endpoint_mode": "fly"}),
        ("pyroki.PlanLinear", {"num_waypoints": 10**9}),
        ("pyroki.PlanLinear", {"dt": 0.0}),
    ],
)
def test_settings_outside_their_range(asked, name, changes):
    goal = {}
    if name.endswith("MoveToJoints"):
        goal = {"joint_config": JointState(asked.good.joints.positions - 0.2)}
    assert asked.ask(TOOLS[f"{name}@embedded"], **goal, **changes) in {
        "range",
        "shape",
        "not_finite",
        "choice",
        "budget",
    }
