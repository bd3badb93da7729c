"""`clock.*`: letting time pass."""

from __future__ import annotations

from gap_motion.arguments import arm_of
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool

LONGEST = 600.0  # s


@tool("clock.Wait", effect="actuate", resources=("arm:{arm_id}", "clock"), deadline_s=LONGEST + 10)
def wait(ctx: ToolContext, seconds: float, arm_id: int = 0) -> None:
    """Hold an arm where it is while `seconds` of the cell's time pass. Raises `BadRequestError` (`range`)."""
    if not 0 <= seconds <= LONGEST:
        raise BadRequestError("range", f"Cannot wait {seconds} s; 0 to {LONGEST:g} s is possible.")
    arm_of(ctx, arm_id)
    ctx.cell.wait(seconds)


TOOLS = (wait,)
