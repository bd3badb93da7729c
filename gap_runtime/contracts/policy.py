"""A learned policy: what one implements to be a provider of the tool `policy.Act`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from gap_runtime.contracts.tool import Tool, ToolContext, ToolRequest, serves
from gap_runtime.contracts.types import ActionChunk, Observation


class Policy(Protocol):
    """Maps what the robot senses and an instruction to the next actions."""

    def reset(self) -> None:
        """Forget the episode before; called before the first `act` of every episode."""

    def act(self, observation: Observation, instruction: str) -> ActionChunk:
        """The next targets of one arm. Raises `ToolError` where it cannot say any."""


class Act(ToolRequest[ActionChunk], tool="policy.Act", effect="sense", deadline_s=10.0):
    """Ask a learned policy for the next actions; each registered policy serves this under its name as provider."""

    observation: Observation
    instruction: str


def policy_tool(name: str, factory: Callable[[], Policy]) -> Tool:
    """`policy.Act` as the policy that `factory` builds, once per process, serves it."""

    @serves(Act, provider=name)
    def act(ctx: ToolContext, request: Act) -> ActionChunk:
        policy: Policy = ctx.shared(f"policy:{name}", factory)
        if not ctx.state.setdefault(f"policy:{name}", False):
            policy.reset()
            ctx.state[f"policy:{name}"] = True
        return policy.act(request.observation, request.instruction)

    return act
