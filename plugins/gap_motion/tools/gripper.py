"""`gripper.*`: a parallel jaw opened, closed and read."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_motion.arguments import arm_of
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, GripperState, Se3Pose

SETTLE_STEP = 0.001  # s: one `settle_steps` step, granted after the jaws have stopped; their travel is not counted
HOLD = ("arm:{arm_id}", "gripper:{arm_id}", "clock")


class GripperPose(NamedTuple):
    """Where the gripper is."""

    pose: Annotated[Se3Pose, WORLD]


@tool("gripper.Open", effect="actuate", resources=HOLD, deadline_s=30.0)
def open_gripper(ctx: ToolContext, arm_id: int = 0, settle_steps: int = 40) -> GripperState:
    """Open the jaws fully, then let `settle_steps` times 1 ms of world time pass; the state after that.

    An arm under way (`nonblocking`) goes on meanwhile. Raises `BadRequestError`, `MotionError`.
    """
    return arm_of(ctx, arm_id).gripper.open(settle=_settle(settle_steps))


@tool("gripper.Close", effect="actuate", resources=HOLD, deadline_s=30.0)
def close_gripper(ctx: ToolContext, arm_id: int = 0, settle_steps: int = 60) -> GripperState:
    """Close the jaws until something stops them, then let `settle_steps` times 1 ms pass; the state after that.

    It goes on squeezing afterwards. A `width` near zero means that nothing is between the jaws. An arm under way
    (`nonblocking`) goes on meanwhile. Raises `BadRequestError`, `MotionError`.
    """
    return arm_of(ctx, arm_id).gripper.close(settle=_settle(settle_steps))


@tool("gripper.GetPosition", effect="sense")
def get_position(ctx: ToolContext, arm_id: int = 0) -> GripperState:
    """How far the jaws are open now, and how hard they squeeze."""
    return arm_of(ctx, arm_id).gripper.state()


@tool("gripper.GetPose", effect="sense")
def get_pose(ctx: ToolContext, arm_id: int = 0) -> GripperPose:
    """T_world_tcp of the gripper: the point between its fingertips, z along the approach."""
    return GripperPose(arm_of(ctx, arm_id).state().ee_pose)


def _settle(steps: int) -> float:
    if not 0 <= steps <= 2000:
        raise BadRequestError("range", f"settle_steps must be 0 to 2000, got {steps}.")
    return steps * SETTLE_STEP


TOOLS = (open_gripper, close_gripper, get_position, get_pose)
