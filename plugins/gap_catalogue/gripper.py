"""A parallel jaw opened, closed and read: `gripper.*`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import (
    WORLD,
    GripperState,
    Se3Pose,
)

HOLD = ("arm:{arm_id}", "gripper:{arm_id}", "clock")


class GripperPose(NamedTuple):
    """Where the gripper is."""

    pose: Annotated[Se3Pose, WORLD]


class OpenGripper(ToolRequest[GripperState], tool="gripper.Open", effect="actuate", resources=HOLD, deadline_s=30.0):
    """Open the jaws fully, then let `settle_steps` times 1 ms of world time pass; the state after that.

    An arm under way (`nonblocking`) goes on meanwhile. Raises `BadRequestError`, `MotionError`.
    """

    arm_id: int = 0
    settle_steps: int = 40


class CloseGripper(ToolRequest[GripperState], tool="gripper.Close", effect="actuate", resources=HOLD, deadline_s=30.0):
    """Close the jaws until something stops them, then let `settle_steps` times 1 ms pass; the state after that.

    It goes on squeezing afterwards. A `width` near zero means that nothing is between the jaws. An arm under way
    (`nonblocking`) goes on meanwhile. Raises `BadRequestError`, `MotionError`.
    """

    arm_id: int = 0
    settle_steps: int = 60


class GetGripperPosition(ToolRequest[GripperState], tool="gripper.GetPosition", effect="sense"):
    """How far the jaws are open now, and how hard they squeeze."""

    arm_id: int = 0


class GetGripperPose(ToolRequest[GripperPose], tool="gripper.GetPose", effect="sense"):
    """T_world_tcp of the gripper: the point between its fingertips, z along the approach."""

    arm_id: int = 0
