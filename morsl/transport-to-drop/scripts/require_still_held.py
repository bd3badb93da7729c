"""Raises when the object was lost during the lift: there is nothing left to carry."""

from __future__ import annotations

from typing import Annotated

from gap_runtime.contracts.failures import GraspError
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, GripperState, OrientedBoundingBox


def run(
    ctx: ScriptContext,
    gripper: GripperState,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    min_width_fraction: float = 0.3,
) -> None:
    """Compare the jaw opening with the object's narrower horizontal side. Raises `GraspError` (`lost`)."""
    side = 2 * min(target_obb.extent.x, target_obb.extent.y)
    if gripper.width < min_width_fraction * side:
        raise GraspError(
            "lost",
            f"The jaws are {1000 * gripper.width:.1f} mm apart after the lift of an object {1000 * side:.0f} mm wide.",
            detail={"width": gripper.width, "side": side},
        )
