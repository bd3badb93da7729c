"""What every motion command begins with: an arm that has done what was started before."""

from __future__ import annotations

from gap_motion.arguments import ArmModel
from gap_runtime.contracts.types import Array


def at_rest(cell: ArmModel) -> Array:
    """The joints (n,) to plan from: where the arm is once a motion under way has ended. Raises its `MotionError`."""
    cell.arm.finish()
    return cell.joints()
