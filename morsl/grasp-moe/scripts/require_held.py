"""Raises when the jaws closed on nothing: what comes next would carry air."""

from __future__ import annotations

from gap_runtime.contracts.failures import GraspError
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import GripperState


def run(ctx: ScriptContext, gripper: GripperState, min_width: float = 0.0015) -> None:
    """Compare the jaw opening [m] with the thinnest thing that counts. Raises `GraspError` (`nothing_held`)."""
    if gripper.width < min_width:
        raise GraspError(
            "nothing_held",
            f"The jaws closed to {1000 * gripper.width:.1f} mm; a rim would leave {1000 * min_width:.1f} mm.",
            detail={"width": gripper.width, "least": min_width, "force": gripper.force},
        )
