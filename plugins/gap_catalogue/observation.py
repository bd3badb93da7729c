"""What the cell's own sensors report: `observation.*`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import (
    WORLD,
    ArmState,
    CameraObservation,
    Se3Pose,
)


class Sensed(NamedTuple):
    """All cameras and all arms at one instant."""

    cameras: list[CameraObservation]
    arm_states: list[ArmState]


class CameraPose(NamedTuple):
    """T_world_camera (optical)."""

    pose: Annotated[Se3Pose, WORLD]


class GetObservation(ToolRequest[Sensed], tool="observation.GetObservation", effect="sense"):
    """Read every camera (RGB-D, calibrated) and every arm, all at one instant."""


class GetCameraPose(ToolRequest[CameraPose], tool="observation.GetCameraPose", effect="sense"):
    """T_world_camera (optical) of one camera, from calibration and forward kinematics. Raises `UnknownNameError`."""

    camera_name: str
