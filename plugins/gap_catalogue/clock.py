"""Letting time pass: `clock.*`."""

from __future__ import annotations

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest

LONGEST = 600.0  # s


class Wait(
    ToolRequest[None],
    tool="clock.Wait",
    effect="actuate",
    resources=("arm:{arm_id}", "clock"),
    deadline_s=LONGEST + 10,
):
    """Hold an arm where it is while `seconds` of the cell's time pass. Raises `BadRequestError` (`range`)."""

    seconds: float
    arm_id: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.seconds <= LONGEST:
            raise BadRequestError("range", f"Cannot wait {self.seconds} s; 0 to {LONGEST:g} s is possible.")
