"""Observation tools (`observation.*`): what the cell's own sensors report."""

from __future__ import annotations

from gap_catalogue.observation import CameraPose, GetCameraPose, GetObservation, Sensed
from gap_catalogue.shared.frames import remember
from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.tool import ToolContext, serves


@serves(GetObservation)
def get_observation(ctx: ToolContext, request: GetObservation) -> Sensed:
    """The frames are remembered for this episode, so that a tool given only an image can look at its depth too."""
    observation = ctx.cell.observe()
    remember(ctx.state, observation)
    return Sensed(list(observation.cameras), list(observation.arm_states))


@serves(GetCameraPose)
def get_camera_pose(ctx: ToolContext, request: GetCameraPose) -> CameraPose:
    if request.camera_name not in ctx.cell.camera_names:
        raise UnknownNameError("camera", request.camera_name, ctx.cell.camera_names)
    return CameraPose(ctx.cell.camera_pose(request.camera_name))


TOOLS = (get_observation, get_camera_pose)
