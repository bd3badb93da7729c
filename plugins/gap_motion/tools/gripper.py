"""`gripper.*`: a parallel jaw opened, closed and read."""

from __future__ import annotations

from gap_catalogue.gripper import CloseGripper, GetGripperPose, GetGripperPosition, GripperPose, OpenGripper
from gap_motion.arguments import arm_of
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import GripperState

SETTLE_STEP = 0.001  # s: one `settle_steps` step, granted after the jaws have stopped; their travel is not counted
HOLD = ("arm:{arm_id}", "gripper:{arm_id}", "clock")


@serves(OpenGripper)
def open_gripper(ctx: ToolContext, request: OpenGripper) -> GripperState:
    return arm_of(ctx, request.arm_id).gripper.open(settle=_settle(request.settle_steps))


@serves(CloseGripper)
def close_gripper(ctx: ToolContext, request: CloseGripper) -> GripperState:
    return arm_of(ctx, request.arm_id).gripper.close(settle=_settle(request.settle_steps))


@serves(GetGripperPosition)
def get_position(ctx: ToolContext, request: GetGripperPosition) -> GripperState:
    return arm_of(ctx, request.arm_id).gripper.state()


@serves(GetGripperPose)
def get_pose(ctx: ToolContext, request: GetGripperPose) -> GripperPose:
    return GripperPose(arm_of(ctx, request.arm_id).state().ee_pose)


def _settle(steps: int) -> float:
    if not 0 <= steps <= 2000:
        raise BadRequestError("range", f"settle_steps must be 0 to 2000, got {steps}.")
    return steps * SETTLE_STEP


TOOLS = (open_gripper, close_gripper, get_position, get_pose)
