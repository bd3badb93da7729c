"""A task: the tuple <L, E, R, O, X, B, J> of the paper, with one variant applied."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.models import Document
from gap_runtime.contracts.sensors import Sensors
from gap_runtime.contracts.task.belief import Belief
from gap_runtime.contracts.task.cell import CameraPlacement, Environment, RobotPlacement
from gap_runtime.contracts.task.objects import Joint, ObjectModel
from gap_runtime.contracts.task.quantities import Positive


class Reward(Document):
    """J = success_weight * success + throughput_weight * (successes per second of cycle time)."""

    success_weight: float = 1.0
    throughput_weight: float = 1.0


class SequenceStep(Document):
    """J: something that must have been true, for `hold` [s] without a break, after the steps before it."""

    name: str
    when: str
    hold: float = Field(default=0.0, ge=0)


class Task(Document):
    """One task, with its variant applied. `path` is the directory it was read from."""

    schema_: Literal["gap/task/v1"] = Field(alias="schema")
    name: str = Field(pattern=r"^[a-z][a-z0-9]*(-[a-z0-9]+)*$", max_length=64)
    description: str
    instructions: list[str] = Field(min_length=1)
    environment: Environment
    robots: list[RobotPlacement] = Field(min_length=1)
    cameras: dict[str, CameraPlacement] = {}
    sensors: Sensors = Sensors()
    objects: dict[str, ObjectModel]
    joints: dict[str, Joint] = {}
    belief: Belief
    scenes: dict[str, dict[str, str]]
    success: dict[str, str]
    sequence: list[SequenceStep] = []
    reward: Reward = Reward()
    max_time: Positive = 120.0
    variant: str = ""
    variants: dict[str, dict[str, Any]] = {}
    path: Path = Path()

    @field_validator("objects")
    @classmethod
    def _ids(cls, objects: dict[str, ObjectModel]) -> dict[str, ObjectModel]:
        for name in objects:
            if not name.isidentifier() or name != name.lower():
                raise ValueError(f"object id {name!r} must be lower_snake_case")
        return objects

    @model_validator(mode="after")
    def _references(self) -> Task:
        for region, placement in self.belief.regions.items():
            if placement.support not in self.environment.supports:
                raise ValueError(
                    f"belief.regions.{region}.support {placement.support!r} is not in environment.supports"
                )
        for scene, members in self.scenes.items():
            for name, region in members.items():
                if name not in self.objects:
                    raise ValueError(f"scenes.{scene}: {name!r} is not in objects")
                if region not in self.belief.regions:
                    raise ValueError(f"scenes.{scene}.{name}: {region!r} is not in belief.regions")
        return self

    def scene_objects(self, scene: str) -> dict[str, ObjectModel]:
        """The object models present in a scene. Raises `UnknownNameError`."""
        if scene not in self.scenes:
            raise UnknownNameError("scene", scene, self.scenes)
        return {name: self.objects[name] for name in self.scenes[scene]}
