"""E and R of a task: the fixed cell, its robots and its cameras."""

from __future__ import annotations

from gap_runtime.contracts.models import Document
from gap_runtime.contracts.task.quantities import Positive, Triple


class Support(Document):
    """A horizontal surface objects can stand on: its height and half sizes [m]."""

    z: float
    center: tuple[float, float] = (0.0, 0.0)
    half_size: tuple[Positive, Positive]


class Environment(Document):
    """E: the fixed cell. `workspace` is the box, min corner then max corner [m], that commands may not leave."""

    simulator: str = "mujoco"
    supports: dict[str, Support]
    workspace: tuple[Triple, Triple]
    lights: list[Triple] = [(0.0, 0.0, 2.0)]


class RobotPlacement(Document):
    """R: a registered robot and where its base stands in the world."""

    model: str
    position: Triple = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    home: tuple[float, ...] | None = None


class CameraPlacement(Document):
    """R: a fixed camera. Quaternion (w first) of the MuJoCo camera (x right, y up, looking along -z); fovy [deg]."""

    position: Triple
    quaternion: tuple[float, float, float, float]
    fovy: Positive
    resolution: tuple[int, int] = (640, 480)
