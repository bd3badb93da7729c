"""O and X of a task: the kinds of objects, and the joints of what is articulated."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationInfo, model_validator

from gap_runtime.contracts.models import Document
from gap_runtime.contracts.task.mesh_file import measure
from gap_runtime.contracts.task.quantities import Positive, Triple

HOLLOW, HELD, FROM_FILE = ("open_box", "pan", "mug"), ("pan", "mug"), ("mesh", "articulated")


class Shape(Document):
    """Full outer size [m] in the standing pose; the object's origin is the centre of that box, its z axis up.

    `open_box`, `pan` and `mug` have walls and a floor and are open at the top. A pan and a mug are round, as wide as
    their y size; the rest of the x size is a handle, `handle` = its width and its thickness.

    A `mesh` is read from `file` (.obj, .stl, .ply, .glb; relative to the task's folder), scaled by `scale` and turned
    by `rotate` (roll, pitch, yaw [deg]) to stand; its size is measured. It collides as at most `parts` convex pieces.
    `articulated` is a model with joints, MJCF (.xml) or URDF (.urdf), whose origin the file chooses; its size is given.
    `cavity` (centre, half-extents [m], in the object's frame) is the free space inside a container of either kind.
    """

    kind: Literal["box", "cylinder", "open_box", "pan", "mug", "mesh", "articulated"]
    size: tuple[Positive, Positive, Positive]
    wall: Positive | None = None
    floor: Positive | None = None
    handle: tuple[Positive, Positive] | None = None
    file: Path | None = None
    scale: Positive = 1.0
    rotate: Triple = (0.0, 0.0, 0.0)
    parts: int = Field(default=16, ge=1, le=64)
    cavity: tuple[Triple, tuple[Positive, Positive, Positive]] | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or data.get("kind") not in FROM_FILE or "file" not in data:
            return data
        path = (info.context or {}).get("folder", Path()) / str(data["file"])
        if not path.is_file():
            raise ValueError(f"file {data['file']!r} is not there (looked at {path})")
        data = {**data, "file": path}
        if data["kind"] == "mesh" and "size" not in data:
            data["size"] = measure(path, data.get("scale", 1.0), tuple(data.get("rotate", (0.0, 0.0, 0.0)))).size
        return data

    @model_validator(mode="after")
    def _walls(self) -> Shape:
        if (self.kind in HOLLOW) != (self.wall is not None and self.floor is not None):
            raise ValueError("wall and floor are for kinds open_box, pan and mug, and needed there")
        if (self.kind in HELD) != (self.handle is not None):
            raise ValueError("handle is for kinds pan and mug, and needed there")
        if self.kind in HELD and self.size[0] <= self.size[1]:
            raise ValueError(f"a {self.kind} is longer (x) than wide (y): the difference is its handle")
        if (self.kind in FROM_FILE) != (self.file is not None):
            raise ValueError("file is for kinds mesh and articulated, and needed there")
        if self.cavity is not None and self.kind not in FROM_FILE:
            raise ValueError("cavity is for kinds mesh and articulated; the others have one from wall and floor")
        return self


class Part(Document):
    """A named part of an object: the upright box that holds it, by its centre and size [m] in the object's frame."""

    center: Triple
    size: tuple[Positive, Positive, Positive]
    words: list[str] = []


class ObjectModel(Document):
    """O: one kind of object. The id (its key in the task) is its name everywhere; `words` are other names for it.

    `looks` is read by the simulator's builder and by providers that render the model: colours, label text, cap, ...
    A mesh may be given a `density` [kg/m^3] instead of its mass. A `fixed` object is bolted down where its instance
    puts it; an articulated one always is. `parts` are places on it that a graph may ask for by name, such as a knob.
    """

    label: str
    words: list[str] = []
    category: str = "object"
    shape: Shape
    mass: Positive
    density: Positive | None = None
    fixed: bool = False
    friction: Positive = 0.9
    looks: dict[str, Any] = {}
    accepts: list[str] = []
    parts: dict[str, Part] = {}

    @model_validator(mode="before")
    @classmethod
    def _mass(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or not isinstance(data.get("shape"), dict):
            return data
        shape = data["shape"]
        if shape.get("kind") == "articulated":
            return {"mass": 1.0, "fixed": True, **data}  # its links carry their own masses
        if "density" not in data:
            return data
        if shape.get("kind") != "mesh" or "mass" in data:
            raise ValueError("density is for kind mesh, in place of mass")
        path = (info.context or {}).get("folder", Path()) / str(shape.get("file", ""))
        if not path.is_file():
            return {"mass": 1.0, **data}  # the shape says what is wrong
        found = measure(path, shape.get("scale", 1.0), tuple(shape.get("rotate", (0.0, 0.0, 0.0))))
        return {**data, "mass": data["density"] * found.volume}

    @property
    def is_container(self) -> bool:
        """True when things can be put into it."""
        return bool(self.accepts)


class Joint(Document):
    """X: one articulated degree of freedom [rad or m]."""

    range: tuple[float, float]
    initial: float = 0.0
