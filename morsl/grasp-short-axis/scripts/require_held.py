"""Raises when the jaws closed on nothing: what comes next would carry air."""

from __future__ import annotations

from gap_runtime.contracts.failures import GraspError
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import GripperState


def run(ctx: ScriptContext, gripper: GripperState, width: float, min_width_fraction: float = 0.3) -> None:
    """Compare the jaw opening [m] with the planned `width`. Raises `GraspError` (`nothing_held`)."""
    least = min_width_fraction * width
    if gripper.width < least:
        raise GraspError(
            "nothing_held",
            f"The jaws closed to {1000 * gripper.width:.1f} mm; the object is {1000 * width:.0f} mm wide.",
            detail={"width": gripper.width, "least": least, "force": gripper.force},
        )
