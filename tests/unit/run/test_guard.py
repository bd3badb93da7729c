"""What a node may do with the cell: what is declared, with the leases that the declaration asks for."""

import time

import numpy as np
import pytest

from gap_runtime.contracts.access import access, declared
from gap_runtime.contracts.arm import Arm, Compliance, Gripper
from gap_runtime.contracts.cell import Cell, LockstepCell
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Quaternion, Se3Pose, Trajectory, Vec3
from gap_runtime.testing import FakeArm, FakeCell, fake_workflow, run_fake
from gap_runtime.testing.arm import steps

WAY = Trajectory(np.array([0.0, 0.1]), np.zeros((2, 2)))
POSE = Se3Pose(Vec3(0.4, 0.0, 0.3), Quaternion(1.0, 0.0, 0.0, 0.0))
CALLS = {
    "execute": lambda arm: arm.execute(WAY),
    "start": lambda arm: arm.start(WAY),
    "finish": lambda arm: arm.finish(),
    "move_guarded": lambda arm: arm.move_guarded(WAY, force=5.0),
    "move_compliant": lambda arm: arm.move_compliant(POSE, Compliance(POSE, (0.0,) * 6), force_limit=5.0, timeout=0.1),
    "open": lambda arm: arm.gripper.open(),
    "close": lambda arm: arm.gripper.close(),
    "set_width": lambda arm: arm.gripper.set_width(0.01),
    "set_force": lambda arm: arm.gripper.set_force(5.0),
    "polish": lambda arm: arm.polish(),
}


class PolishingArm(FakeArm):
    """An arm whose plugin adds to the contract."""

    @access("actuate", "arm:{arm_id}")
    def polish(self) -> None:
        """Declared."""
        self.commands.append("polish")
        self._timeline.take(steps(0.02))

    @property
    @access("sense")
    def temperature(self) -> float:
        """Declared."""
        return 40.0

    def hammer(self) -> None:
        """Not declared."""
        self.commands.append("hammer")


@pytest.fixture
def cell():
    made = FakeCell(arms=2)
    made.arms = tuple(PolishingArm(made, i) for i in range(2))
    return made


def run(cell, do, resources=(), effect="actuate", **node):
    @tool("fake.Do", effect=effect, resources=resources, deadline_s=5.0)
    def use(ctx: ToolContext) -> None:
        """Uses the cell."""
        do(ctx.cell)

    workflow = fake_workflow({"a": {"type": "tool", "tool": "fake.Do", **node}}, [("START", "a"), ("a", "done")])
    return run_fake(workflow, use, cell=cell, grace_s=0.2)


@pytest.mark.parametrize("contract", [Arm, Gripper, Cell, LockstepCell, Simulator])
def test_every_member_of_a_contract_says_what_it_does(contract):
    ours = {n for base in contract.__mro__ if base.__module__.startswith("gap_") for n in vars(base)}
    assert {n for n in ours if not n.startswith("_")} <= set(declared(contract))


@pytest.mark.parametrize("command", CALLS)
def test_a_command_needs_the_lease_of_its_own_arm(cell, command):
    held = "gripper" if command in declared(Gripper) else "arm"
    assert run(cell, lambda c: CALLS[command](c.arms[1]), (f"{held}:1", "clock")).status == "success"
    commands = list(cell.arms[1].commands)
    result = run(cell, lambda c: CALLS[command](c.arms[1]), (f"{held}:0", "clock"))
    assert result.causes[0].code == "lease" and cell.arms[1].commands == commands


@pytest.mark.parametrize("command", CALLS)
def test_a_node_that_only_looks_commands_nothing(cell, command):
    result = run(cell, lambda c: CALLS[command](c.arms[0]), effect="sense")
    assert result.causes[0].code == "lease" and cell.arms[0].commands == []


def test_what_a_plugin_does_not_declare_is_refused(cell):
    result = run(cell, lambda c: c.arms[0].hammer(), ("arm:0", "clock"))
    assert result.causes[0].code == "undeclared" and cell.arms[0].commands == []
    assert "PolishingArm.hammer" in result.error and "@access" in str(result.causes[0])
    assert run(cell, lambda c: c.take(steps(1.0)), ("clock",)).causes[0].code == "undeclared"


def test_what_a_plugin_declares_to_be_sensed_can_be_read_and_only_until_the_node_is_stopped(cell):
    seen = []
    assert run(cell, lambda c: seen.append(c.arms[0].temperature), effect="sense").status == "success"
    assert seen == [40.0]

    def late(guarded):
        time.sleep(0.15)
        seen.append(guarded.arms[0].temperature)

    assert run(cell, late, effect="sense", deadline_s=0.005).causes[0].code == "deadline" and seen == [40.0]


def test_a_declared_command_is_held_to_the_nodes_deadline_in_cell_time(cell):
    def polish(guarded):
        while True:
            guarded.arms[0].polish()

    result = run(cell, polish, ("arm:0", "clock"), deadline_s=0.5)
    assert result.causes[0].code == "deadline" and len(cell.arms[0].commands) == pytest.approx(25, abs=1)


def test_stop_needs_no_lease(cell):
    assert run(cell, lambda c: c.arms[1].stop(), effect="sense").status == "success" and cell.arms[1].stops == 1


def test_a_method_that_this_cell_lacks_is_unsupported(cell):
    assert run(cell, lambda c: c.execute({0: WAY}), ("arm:0", "clock")).causes[0].code == "unsupported"
