"""A task: the tuple <L, E, R, O, X, B, J> of the paper, read from task.yaml, with named variants as overlays."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from gap_runtime.contracts.documents import read_yaml
from gap_runtime.contracts.failures import DocumentError, UnknownNameError, did_you_mean
from gap_runtime.contracts.models import Document
from gap_runtime.contracts.sensors import Sensors

Triple = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]


class Support(Document):
    """A horizontal surface objects can stand on: its height and half sizes [m]."""

    z: float
    center: tuple[float, float] = (0.0, 0.0)
    half_size: tuple[Positive, Positive]


class Environment(Document):
    """E: the fixed cell. `workspace` is the box, min corner then max corner [m], that commands may not leave."""

    world: str = "mujoco"
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


class Shape(Document):
    """Full outer size [m] in the standing pose.

    `open_box`, `pan` and `mug` have walls and a floor and are open at the top. A pan and a mug are round, as wide as
    their y size; the rest of the x size is a handle, `handle` = its width and its thickness.
    """

    kind: Literal["box", "cylinder", "open_box", "pan", "mug"]
    size: tuple[Positive, Positive, Positive]
    wall: Positive | None = None
    floor: Positive | None = None
    handle: tuple[Positive, Positive] | None = None

    @model_validator(mode="after")
    def _walls(self) -> Shape:
        hollow, held = self.kind in ("open_box", "pan", "mug"), self.kind in ("pan", "mug")
        if hollow != (self.wall is not None and self.floor is not None):
            raise ValueError("wall and floor are for kinds open_box, pan and mug, and needed there")
        if held != (self.handle is not None):
            raise ValueError("handle is for kinds pan and mug, and needed there")
        if held and self.size[0] <= self.size[1]:
            raise ValueError(f"a {self.kind} is longer (x) than wide (y): the difference is its handle")
        return self


class ObjectModel(Document):
    """O: one kind of object. The id (its key in the task) is its name everywhere; `words` are other names for it.

    `looks` is read by the world's builder and by providers that render the model: colours, label text, cap, ...
    """

    label: str
    words: list[str] = []
    category: str = "object"
    shape: Shape
    mass: Positive
    friction: Positive = 0.9
    looks: dict[str, Any] = {}
    accepts: list[str] = []

    @property
    def is_container(self) -> bool:
        """True when things can be put into it."""
        return bool(self.accepts)


class Joint(Document):
    """X: one articulated degree of freedom [rad or m]."""

    range: tuple[float, float]
    initial: float = 0.0


class Distribution(Document):
    """B: one dm_control composer variation: exactly one of the keys."""

    constant: float | list[float] | None = None
    uniform: tuple[float | list[float], float | list[float]] | None = None
    normal: tuple[float | list[float], float | list[float]] | None = None
    choice: list[float] | None = None

    @model_validator(mode="after")
    def _one(self) -> Distribution:
        given = [k for k in ("constant", "uniform", "normal", "choice") if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give exactly one of constant, uniform, normal, choice (got {', '.join(given) or 'none'})"
            )
        return self


class Placement(Document):
    """B: where an object starts: xy distribution relative to `center` [m], yaw distribution [deg], and the support."""

    center: tuple[float, float]
    offset: Distribution = Distribution(constant=[0.0, 0.0])
    yaw_deg: Distribution = Distribution(constant=0.0)
    support: str


class Belief(Document):
    """B: `regions` are named placements; a scene says which object starts in which. `clearance` [m] is the Minkowski
    margin kept between objects; `attempts` bounds rejection sampling."""

    regions: dict[str, Placement]
    clearance: Positive = 0.01
    attempts: int = Field(default=200, ge=1, le=100_000)


class Reward(Document):
    """J = success_weight * success + throughput_weight * (successes per second of cycle time)."""

    success_weight: float = 1.0
    throughput_weight: float = 1.0


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


def load_task(path: Path, variant: str | None = None) -> Task:
    """Read `path`/task.yaml and lay the variant over it (default: the first one listed).

    A variant is a partial document: mappings merge key by key, anything else replaces; `extends` names another variant
    to lay under it. Raises `DocumentError`, `UnknownNameError`.
    """
    file = path / "task.yaml"
    data = read_yaml(file)
    if not isinstance(data, dict):
        raise DocumentError(str(file), "must be a mapping")
    variants = data.get("variants") or {}
    if not isinstance(variants, dict):
        raise DocumentError(str(file), "variants: must be a mapping")
    chosen = variant or next(iter(variants), "")
    if chosen and chosen not in variants:
        raise UnknownNameError("variant", chosen, variants)
    merged: dict[str, Any] = data
    for overlay in _overlays(variants, chosen, str(file)):
        merged = _merge(merged, overlay)
    return Task.load({**merged, "variant": chosen, "path": path}, str(file))


def _overlays(variants: dict[str, Any], chosen: str, where: str) -> list[dict[str, Any]]:
    """The variant's overlay after those it extends, each without `extends`."""
    found: list[dict[str, Any]] = []
    seen: list[str] = []
    name: Any = chosen or None
    while name is not None:
        if name in seen:
            raise DocumentError(where, f"variants.{chosen}.extends: goes in circles: {' > '.join([*seen, name])}")
        if not isinstance(name, str) or name not in variants:
            key = f"variants.{seen[-1]}.extends"
            raise DocumentError(where, f"{key}: {name!r} is not a variant", hint=did_you_mean(str(name), variants))
        overlay = variants[name] or {}
        if not isinstance(overlay, dict):
            raise DocumentError(where, f"variants.{name}: must be a mapping")
        found.insert(0, {key: value for key, value in overlay.items() if key != "extends"})
        seen.append(name)
        name = overlay.get("extends")
    return found


def _merge(base: Any, overlay: Any) -> Any:
    if not isinstance(overlay, dict) or not isinstance(base, dict):
        return copy.deepcopy(overlay)
    out = dict(base)
    for key, value in overlay.items():
        out[key] = _merge(base.get(key), value) if key in base else copy.deepcopy(value)
    return out
