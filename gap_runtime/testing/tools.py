"""A handful of tools: they add, look, move, fail, wait and tick."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.simulator import simulator_of
from gap_runtime.contracts.tool import Tool, ToolContext, tool
from gap_runtime.contracts.types import GripperState, Observation, Trajectory


class Sum(NamedTuple):
    """What `fake.Add` returns."""

    total: float
    positive: bool


@tool("fake.Nothing", deadline_s=5.0)
def nothing() -> None:
    """Does nothing."""


@tool("fake.Echo", deadline_s=5.0)
def echo(value: Any) -> Any:
    """Gives back what it is given."""
    return value


@tool("fake.Add", deadline_s=5.0)
def add(a: float, b: float = 0.0) -> Sum:
    """Adds two numbers."""
    return Sum(a + b, a + b > 0)


@tool("fake.Fail", deadline_s=5.0)
def fail(message: str = "no luck") -> None:
    """Fails."""
    raise ToolError("fake", message)


@tool("fake.Count", deadline_s=5.0)
def count(ctx: ToolContext) -> int:
    """How often it was called in this episode."""
    ctx.state["count"] = ctx.state.get("count", 0) + 1
    return int(ctx.state["count"])


@tool("fake.Look", effect="sense", deadline_s=5.0)
def look(ctx: ToolContext) -> Observation:
    """What the cameras see."""
    return ctx.cell.observe()


@tool("fake.Peek", effect="sense", deadline_s=5.0)
def peek(ctx: ToolContext) -> None:
    """Tries to read ground truth, which must never work."""
    simulator_of(ctx.cell).snapshot()


@tool("fake.Move", effect="actuate", resources=("arm:{arm_id}",), deadline_s=30.0)
def move(ctx: ToolContext, to: float = 1.0, duration: float = 1.0, arm_id: int = 0) -> float:
    """Turns every joint to `to` [rad] within `duration` [s]; returns the world time when done."""
    arm = ctx.cell.arms[arm_id]
    start = arm.state().joints.positions
    arm.execute(Trajectory(np.array([0.0, duration]), np.stack([start, np.full_like(start, to)])))
    return ctx.cell.time


@tool("fake.Grip", effect="actuate", resources=("gripper:{arm_id}",), deadline_s=5.0)
def grip(ctx: ToolContext, width: float = 0.0, arm_id: int = 0) -> GripperState:
    """Drives the jaws to `width` [m]."""
    return ctx.cell.arms[arm_id].gripper.set_width(width)


@tool("fake.Spin", deadline_s=5.0)
def spin(ctx: ToolContext, seconds: float = 60.0) -> None:
    """Works for `seconds` of wall time and listens while it does."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ctx.raise_if_cancelled()
        time.sleep(0.001)


@tool("fake.Block", deadline_s=5.0)
def block(seconds: float = 60.0) -> None:
    """Sleeps for `seconds` of wall time, deaf to everything."""
    time.sleep(seconds)


@tool("fake.Ticker", streaming=True, deadline_s=5.0)
def ticker(ctx: ToolContext, items: int = 1_000_000) -> Any:
    """Publishes 0, 1, 2, ..."""

    def ticks() -> Iterator[int]:
        for i in range(items):
            ctx.raise_if_cancelled()
            yield i
            time.sleep(0.001)

    return ticks()


FAKE_TOOLS: tuple[Tool, ...] = (nothing, echo, add, fail, count, look, peek, move, grip, spin, block, ticker)
