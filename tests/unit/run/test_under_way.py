"""Motions that a node starts and does not wait for."""

import numpy as np
import pytest

from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Trajectory
from gap_runtime.testing import FakeCell, fake_workflow, run_fake

WAY = Trajectory(np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 1.0]]))


@tool("fake.Start", effect="actuate", resources=("arm:0", "clock"))
def start(ctx: ToolContext) -> float:
    """Starts a motion and returns the world time."""
    ctx.cell.arms[0].start(WAY)
    return ctx.cell.time


@tool("fake.Sneak", effect="actuate", resources=("gripper:0",))
def sneak(ctx: ToolContext) -> None:
    """Starts a motion without holding the arm."""
    ctx.cell.arms[0].start(WAY)


def chain(**nodes):
    names = list(nodes)
    return fake_workflow(nodes, list(zip(["START", *names], [*names, "done"], strict=True)))


def test_a_run_is_over_when_its_arms_are():
    world = FakeCell()
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Start"}), start, cell=world)
    assert result.status == "success" and world.time == pytest.approx(WAY.duration, abs=0.05)
    np.testing.assert_allclose(world.arms[0].state().joints.positions, WAY.positions[-1])


def test_a_node_that_comes_after_finds_the_arm_under_way():
    world = FakeCell()
    then = {"type": "tool", "tool": "fake.Grip"}
    assert run_fake(chain(a={"type": "tool", "tool": "fake.Start"}, b=then), start, cell=world).status == "success"
    assert world.arms[0].commands == ["start", "set_width"] and world.time < WAY.duration + 0.1


def test_what_an_arm_failed_at_unwatched_fails_the_run(monkeypatch):
    world = FakeCell()

    def finish():
        raise MotionError("contact", "The motion started at 0.00 s failed.")

    monkeypatch.setattr(world.arms[0], "finish", finish)
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Nothing"}), cell=world)
    assert result.status == "error" and "started at 0.00 s" in result.error and result.causes[-1].code == "contact"


def test_starting_needs_the_arm_as_moving_does():
    world = FakeCell()
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Sneak"}), sneak, cell=world)
    assert result.causes[0].code == "lease" and world.arms[0].commands == []


class LockstepFake(FakeCell):
    """A fake world that says which arms were moved together."""

    moved = ()

    def execute(self, motions, *, tolerance=0.01):
        self.moved = tuple(sorted(motions))


@tool("fake.Both", effect="actuate", resources=("arm:0", "arm:1", "clock"))
def both(ctx: ToolContext) -> None:
    """Moves two arms at once."""
    ctx.cell.execute({0: WAY, 1: WAY})


@tool("fake.Grab", effect="actuate", resources=("arm:0", "clock"))
def grab(ctx: ToolContext) -> None:
    """Moves two arms at once, holding one."""
    ctx.cell.execute({0: WAY, 1: WAY})


def test_arms_that_move_together_are_all_held():
    world = LockstepFake(arms=2)
    assert run_fake(chain(a={"type": "tool", "tool": "fake.Both"}), both, cell=world).status == "success"
    assert world.moved == (0, 1)
    world = LockstepFake(arms=2)
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Grab"}), grab, cell=world)
    assert result.causes[0].code == "lease" and "arm:1" in result.error and world.moved == ()


def test_a_world_that_moves_one_arm_at_a_time_says_so():
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Both"}), both, cell=FakeCell(arms=2))
    assert result.causes[0].code == "unsupported"
