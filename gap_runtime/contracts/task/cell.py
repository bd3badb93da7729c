"""E and R of a task: the fixed cell, its robots and its cameras."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, field_validator

from gap_runtime.contracts.models import Document, ProblemsError
from gap_runtime.contracts.names import Identifier
from gap_runtime.contracts.task.quantities import (
    Degrees,
    FieldOfView,
    Number,
    Point2,
    Point3,
    Resolution,
    Rotation4,
    Size2,
)

Height = Annotated[float, Field(ge=0, le=10, strict=True, allow_inf_nan=False)]  # m
Light = Point3
MAX_LIGHTS = 7  # OpenGL draws eight, one of which is the headlight


class Support(Document):
    """A horizontal surface objects can stand on: its height and half sizes [m]. At height 0 it is the floor."""

    z: Height
    center: Point2 = (0.0, 0.0)
    half_size: Size2


class Environment(Document):
    """E: the fixed cell. `workspace` is the box, min corner then max corner [m], that commands may not leave."""

    simulator: str = "mujoco"
    supports: Annotated[dict[Identifier, Support], Field(min_length=1)]
    workspace: tuple[Point3, Point3]
    lights: Annotated[list[Light], Field(max_length=MAX_LIGHTS)] = [(0.0, 0.0, 2.0)]

    @field_validator("supports")
    @classmethod
    def _one_floor(cls, supports: dict[str, Support]) -> dict[str, Support]:
        floors = [name for name, support in supports.items() if support.z == 0]
        ProblemsError.raise_any((f"{name}.z", f"0 is the floor, which is {floors[0]} already") for name in floors[1:])
        return supports

    @field_validator("workspace")
    @classmethod
    def _ordered(cls, workspace: tuple[tuple[float, ...], tuple[float, ...]]) -> object:
        ProblemsError.raise_any(
            (f"0.{axis}", f"{low:g} should be less than {high:g}, which is the max corner's")
            for axis, (low, high) in enumerate(zip(*workspace, strict=True))
            if not low < high
        )
        return workspace

    @field_validator("lights")
    @classmethod
    def _shine(cls, lights: list[tuple[float, ...]]) -> object:
        ProblemsError.raise_any(
            (str(i), f"{list(light)} should be away from [0, 0, 0], where lights shine to")
            for i, light in enumerate(lights)
            if math.hypot(*light) < 1e-6
        )
        return lights


class RobotPlacement(Document):
    """R: a registered robot and where its base stands in the world. `home` [rad] is the robot's own unless given."""

    model: str
    position: Point3 = (0.0, 0.0, 0.0)
    yaw_deg: Degrees = 0.0
    home: tuple[Number, ...] | None = None


class CameraPlacement(Document):
    """R: a fixed camera. Quaternion (w first) of the MuJoCo camera (x right, y up, looking along -z); fovy [deg]."""

    position: Point3
    quaternion: Rotation4
    fovy: FieldOfView
    resolution: Resolution = (640, 480)
