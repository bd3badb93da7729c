"""Observation tools (`observation.*`): what the cell's own sensors report."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_perception.frames import remember
from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, ArmState, CameraObservation, Se3Pose


class Sensed(NamedTuple):
    """All cameras and all arms at one instant."""

    cameras: list[CameraObservation]
    arm_states: list[ArmState]


class CameraPose(NamedTuple):
    """T_world_camera (optical)."""

    pose: Annotated[Se3Pose, WORLD]


@tool("observation.GetObservation", effect="sense")
def get_observation(ctx: ToolContext) -> Sensed:
    """Read every camera (RGB-D, calibrated) and every arm, all at one instant.

    The frames are remembered for this episode, so that a tool given only an image can look at its depth too.
    """
    observation = ctx.cell.observe()
    remember(ctx.state, observation)
    return Sensed(list(observation.cameras), list(observation.arm_states))


@tool("observation.GetCameraPose", effect="sense")
def get_camera_pose(ctx: ToolContext, camera_name: str) -> CameraPose:
    """T_world_camera (optical) of one camera, from calibration and forward kinematics. Raises `UnknownNameError`."""
    if camera_name not in ctx.cell.camera_names:
        raise UnknownNameError("camera", camera_name, ctx.cell.camera_names)
    return CameraPose(ctx.cell.camera_pose(camera_name))


TOOLS = (get_observation, get_camera_pose)
