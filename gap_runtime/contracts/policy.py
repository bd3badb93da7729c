"""A learned policy: what one implements to be a provider of the tool `policy.Act`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from gap_runtime.contracts.tool import Tool, ToolContext, serves, tool
from gap_runtime.contracts.types import ActionChunk, Observation


class Policy(Protocol):
    """Maps what the robot senses and an instruction to the next actions."""

    def reset(self) -> None:
        """Forget the episode before; called before the first `act` of every episode."""

    def act(self, observation: Observation, instruction: str) -> ActionChunk:
        """The next targets of one arm. Raises `ToolError` where it cannot say any."""


@tool("policy.Act", effect="sense", deadline_s=10.0)
def contract(ctx: ToolContext, observation: Observation, instruction: str) -> ActionChunk:
    """Ask a learned policy for the next actions; each registered policy serves this under its name as provider."""
    raise NotImplementedError  # a contract: `policy_tool` makes its providers


def policy_tool(name: str, factory: Callable[[], Policy]) -> Tool:
    """`policy.Act` as the policy that `factory` builds, once per process, serves it."""

    @serves(contract, provider=name)
    def act(ctx: ToolContext, observation: Observation, instruction: str) -> ActionChunk:
        policy: Policy = ctx.shared(f"policy:{name}", factory)
        if not ctx.state.setdefault(f"policy:{name}", False):
            policy.reset()
            ctx.state[f"policy:{name}"] = True
        return policy.act(observation, instruction)

    return act
