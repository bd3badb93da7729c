"""Runs a policy window by window until it, or a look at the picture, says that it is done."""

from __future__ import annotations

from typing import Literal, NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import Observation


class Rollout(NamedTuple):
    """How it ended, and after how many chunks."""

    outcome: Literal["finished", "out_of_windows"]
    windows: int


def run(ctx: ScriptContext, instruction: str, question: str, max_windows: int = 25, ask_every: int = 5) -> Rollout:
    """Follow at most `max_windows` chunks of `policy.Act`. Raises what the tools raise."""
    for window in range(1, max_windows + 1):
        seen = ctx.tool("observation.GetObservation")
        observation = Observation(tuple(seen.cameras), tuple(seen.arm_states), seen.cameras[0].stamp)
        chunk = ctx.tool("policy.Act", observation=observation, instruction=instruction)
        ctx.tool("robot_control.ExecuteActionChunk", chunk=chunk)
        asked = bool(question) and window % ask_every == 0
        if chunk.done or (asked and ctx.tool("vlm.QueryYesNo", prompt=question).answer):
            return Rollout("finished", window)
    return Rollout("out_of_windows", max_windows)
