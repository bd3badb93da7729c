"""Motions that a node starts and does not wait for."""

import numpy as np
import pytest

from gap_cli.contracts.failures import MotionError
from gap_cli.contracts.tool import ToolContext, tool
from gap_cli.contracts.types import Trajectory
from gap_cli.testing import FakeWorld, fake_workflow, run_fake

WAY = Trajectory(np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 1.0]]))


@tool("fake.Start", effect="actuate", resources=("arm:0", "clock"))
def start(ctx: ToolContext) -> float:
    """Starts a motion and returns the world time."""
    ctx.world.arms[0].start(WAY)
    return ctx.world.time


@tool("fake.Sneak", effect="actuate", resources=("gripper:0",))
def sneak(ctx: ToolContext) -> None:
    """Starts a motion without holding the arm."""
    ctx.world.arms[0].start(WAY)


def chain(**nodes):
    names = list(nodes)
    return fake_workflow(nodes, list(zip(["START", *names], [*names, "done"], strict=True)))


def test_a_run_is_over_when_its_arms_are():
    world = FakeWorld()
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Start"}), start, world=world)
    assert result.status == "success" and world.time == pytest.approx(WAY.duration, abs=0.05)
    np.testing.assert_allclose(world.arms[0].state().joints.positions, WAY.positions[-1])


def test_a_node_that_comes_after_finds_the_arm_under_way():
    world = FakeWorld()
    then = {"type": "tool", "tool": "fake.Grip"}
    assert run_fake(chain(a={"type": "tool", "tool": "fake.Start"}, b=then), start, world=world).status == "success"
    assert world.arms[0].commands == ["start", "set_gripper"] and world.time < WAY.duration + 0.1


def test_what_an_arm_failed_at_unwatched_fails_the_run(monkeypatch):
    world = FakeWorld()

    def finish():
        raise MotionError("contact", "The motion started at 0.00 s failed.")

    monkeypatch.setattr(world.arms[0], "finish", finish)
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Nothing"}), world=world)
    assert result.status == "error" and "started at 0.00 s" in result.error and result.causes[-1].code == "contact"


def test_starting_needs_the_arm_as_moving_does():
    world = FakeWorld()
    result = run_fake(chain(a={"type": "tool", "tool": "fake.Sneak"}), sneak, world=world)
    assert result.causes[0].code == "lease" and world.arms[0].commands == []
