"""A task: the tuple <L, E, R, O, X, B, J> of the paper, with one variant applied."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator

from gap_runtime.contracts.failures import GapError, UnknownNameError
from gap_runtime.contracts.models import Document, ProblemsError, unknown
from gap_runtime.contracts.names import Identifier, KebabName, Name
from gap_runtime.contracts.task.belief import Belief
from gap_runtime.contracts.task.cell import CameraPlacement, Environment, RobotPlacement
from gap_runtime.contracts.task.objects import Joint, ObjectModel
from gap_runtime.contracts.task.quantities import Seconds, Text, Weight
from gap_runtime.contracts.task.reading import Installed, installed_of
from gap_runtime.contracts.task.robots import Placed, base_problems, home_problems, mounted_cameras
from gap_runtime.contracts.task.sensors import Sensors
from gap_runtime.contracts.task.success import asks_about_something, condition_problems

RESERVED = "robot"  # contacts name a robot's parts `robot:<arm>:<link>`


class Reward(Document):
    """J = success_weight * success + throughput_weight * (successes per second of cycle time)."""

    success_weight: Weight = 1.0
    throughput_weight: Weight = 1.0


class SequenceStep(Document):
    """J: something that must have been true, for `hold` [s] without a break, after the steps before it."""

    name: Identifier
    when: str
    hold: Annotated[float, Field(ge=0, le=3600, strict=True, allow_inf_nan=False)] = 0.0


class Task(Document):
    """One task, with its variant applied. `path` is the directory it was read from.

    A validator of one section may ask for those above it, which are missing where they are wrong themselves; what
    needs more than the document runs where the context is a `Reading` that says what is installed.
    """

    schema_: Literal["gap/task/v1"] = Field(alias="schema")
    name: KebabName
    description: Text
    instructions: list[Text] = Field(min_length=1)
    environment: Environment
    robots: list[RobotPlacement] = Field(min_length=1)
    cameras: dict[Name, CameraPlacement] = {}
    sensors: Sensors = Sensors()
    objects: Annotated[dict[Identifier, ObjectModel], Field(min_length=1)]
    joints: dict[Identifier, Joint] = {}
    belief: Belief
    scenes: Annotated[dict[Identifier, Annotated[dict[str, str], Field(min_length=1)]], Field(min_length=1)]
    success: Annotated[dict[Identifier, str], Field(min_length=1)]
    sequence: list[SequenceStep] = []
    reward: Reward = Reward()
    max_time: Seconds = 120.0
    variant: str = ""
    variants: dict[Name, dict[str, Any] | None] = {}
    path: Path = Path()

    @field_validator("name")
    @classmethod
    def _found_by(cls, name: str, info: ValidationInfo) -> str:
        installed = installed_of(info)
        if installed is not None and name != installed.name:
            raise ValueError(f"{name!r} should be {installed.name!r}, the name of its folder; rename either")
        return name

    @field_validator("environment")
    @classmethod
    def _simulated(cls, environment: Environment, info: ValidationInfo) -> Environment:
        installed = installed_of(info)
        if installed is not None:
            asked = [("simulator", environment.simulator)]
            ProblemsError.raise_any(unknown(asked, installed.simulators, "an installed simulator"))
        return environment

    @field_validator("robots")
    @classmethod
    def _fitting(cls, robots: list[RobotPlacement], info: ValidationInfo) -> list[RobotPlacement]:
        installed = installed_of(info)
        if installed is not None:
            ProblemsError.raise_any(_robot_problems(robots, installed))
        return robots

    @field_validator("cameras")
    @classmethod
    def _own(cls, cameras: dict[str, CameraPlacement], info: ValidationInfo) -> dict[str, CameraPlacement]:
        ProblemsError.raise_any(
            (name, f"{name!r} is the name of the robot's own camera; choose another")
            for name in _mounted(info)
            if name in cameras
        )
        return cameras

    @field_validator("sensors")
    @classmethod
    def _of_cameras(cls, sensors: Sensors, info: ValidationInfo) -> Sensors:
        known_all = installed_of(info) is not None and {"robots", "cameras"} <= info.data.keys()
        if known_all and isinstance(sensors.use, dict):
            known = [*info.data["cameras"], *_mounted(info)]
            ProblemsError.raise_any(unknown([(f"use.{n}", n) for n in sensors.use], known, "a camera"))
        return sensors

    @field_validator("objects")
    @classmethod
    def _told_apart(cls, objects: dict[str, ObjectModel], info: ValidationInfo) -> dict[str, ObjectModel]:
        ProblemsError.raise_any(_object_problems(objects, info.data.get("environment")))
        return objects

    @field_validator("belief")
    @classmethod
    def _standing(cls, belief: Belief, info: ValidationInfo) -> Belief:
        if "environment" in info.data:
            asked = [(f"regions.{name}.support", region.support) for name, region in belief.regions.items()]
            ProblemsError.raise_any(unknown(asked, info.data["environment"].supports, "in environment.supports"))
        return belief

    @field_validator("scenes")
    @classmethod
    def _known(cls, scenes: dict[str, dict[str, str]], info: ValidationInfo) -> dict[str, dict[str, str]]:
        problems: list[tuple[str, str]] = []
        for scene, members in scenes.items():
            if "objects" in info.data:
                problems += unknown([(f"{scene}.{name}", name) for name in members], info.data["objects"], "in objects")
            if "belief" in info.data:
                asked = [(f"{scene}.{name}", region) for name, region in members.items()]
                problems += unknown(asked, info.data["belief"].regions, "in belief.regions")
        ProblemsError.raise_any(problems)
        return scenes

    @field_validator("success")
    @classmethod
    def _judged(cls, success: dict[str, str], info: ValidationInfo) -> dict[str, str]:
        problems = list(condition_problems(success, _known_to_conditions(info.data)))
        if not any(asks_about_something(expression) for expression in success.values()):
            problems.append(("", "no condition asks about an object, a joint or an arm: success would say nothing"))
        ProblemsError.raise_any(problems)
        return success

    @field_validator("sequence")
    @classmethod
    def _in_order(cls, sequence: list[SequenceStep], info: ValidationInfo) -> list[SequenceStep]:
        names = [step.name for step in sequence]
        twice = [(f"{i}.name", f"{n!r} is a step's name already") for i, n in enumerate(names) if n in names[:i]]
        conditions = {f"{i}.when": step.when for i, step in enumerate(sequence)}
        ProblemsError.raise_any(
            [*twice, *condition_problems(conditions, _known_to_conditions(info.data), slots_given=())]
        )
        return sequence

    def scene_objects(self, scene: str) -> dict[str, ObjectModel]:
        """The object models present in a scene. Raises `UnknownNameError`."""
        if scene not in self.scenes:
            raise UnknownNameError("scene", scene, self.scenes)
        return {name: self.objects[name] for name in self.scenes[scene]}


def _robot_problems(robots: list[RobotPlacement], installed: Installed) -> Iterator[tuple[str, str]]:
    placed: list[Placed] = []
    for i, placement in enumerate(robots):
        try:
            spec = installed.robot(placement.model)
        except GapError as error:
            yield f"{i}.model", str(error)
            continue
        placed.append((placement, spec))
        yield from ((f"{i}.{key}", text) for key, text in home_problems(placement, spec))
    if len(placed) == len(robots):
        yield from base_problems(placed)


def _known_to_conditions(data: Mapping[str, Any]) -> dict[str, Collection[str]]:
    """What conditions may name, as far as the sections that say it are right."""
    known: dict[str, Collection[str]] = {}
    if "objects" in data:
        known["bodies"] = {*data["objects"], *(model.label for model in data["objects"].values())}
        if "environment" in data:
            known["contacts"] = {*data["objects"], *data["environment"].supports, RESERVED}
    if "joints" in data:
        known["joints"] = data["joints"]
    if "robots" in data:
        known["arms"] = [str(arm) for arm in range(len(data["robots"]))]
    return known


def _mounted(info: ValidationInfo) -> list[str]:
    """Names of the robots' cameras; none where the robots are not known."""
    installed = installed_of(info)
    if installed is None or "robots" not in info.data:
        return []
    return [camera.name for camera in mounted_cameras([installed.robot(p.model) for p in info.data["robots"]])]


def _object_problems(objects: dict[str, ObjectModel], environment: Environment | None) -> Iterator[tuple[str, str]]:
    """Names that mean two things, and what containers accept but no object is."""
    kinds = {*objects, *(model.category for model in objects.values()), "*"}
    supports = environment.supports if environment is not None else {}
    for name, model in objects.items():
        if name in supports or name == RESERVED:
            yield name, f"{name!r} is also {'a support' if name in supports else 'what a robot is called'}; rename it"
        if model.label in objects and model.label != name:
            yield f"{name}.label", f"{model.label!r} is the id of another object"
        asked = [(f"{name}.accepts.{i}", kind) for i, kind in enumerate(model.accepts)]
        yield from unknown(asked, kinds, "the id or the category of an object")
