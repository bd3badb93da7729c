"""`clock.*`: letting time pass."""

from __future__ import annotations

from gap_catalogue.clock import Wait
from gap_motion.arguments import arm_of
from gap_runtime.contracts.tool import ToolContext, serves


@serves(Wait)
def wait(ctx: ToolContext, request: Wait) -> None:
    arm_of(ctx, request.arm_id)
    ctx.cell.wait(request.seconds)


TOOLS = (wait,)
