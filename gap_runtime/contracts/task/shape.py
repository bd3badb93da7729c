"""The shapes of a task's objects: primitives, containers, meshes and articulated models from files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from gap_runtime.contracts.models import Document, ProblemsError
from gap_runtime.contracts.task.mesh_file import Measured, measure
from gap_runtime.contracts.task.quantities import Degrees3, Point3, Scale, Size3, Thickness
from gap_runtime.contracts.task.reading import folder_of

HOLLOW, HELD, FROM_FILE = ("open_box", "pan", "mug"), ("pan", "mug"), ("mesh", "articulated")
SUFFIXES = {"mesh": (".obj", ".stl", ".ply", ".glb"), "articulated": (".xml", ".urdf")}


def _present(file: Path, info: ValidationInfo) -> Path:
    path = folder_of(info) / file
    if not path.is_file():
        raise ValueError(f"{str(file)!r} is not there (looked at {path})")
    return path


class Shape(Document):
    """Full outer size [m] in the standing pose.

    `open_box`, `pan` and `mug` have walls and a floor and are open at the top. A pan and a mug are round, as wide as
    their y size; the rest of the x size is a handle, `handle` = its width and its thickness.

    A `mesh` is read from `file` (.obj, .stl, .ply, .glb; relative to the task's folder), scaled by `scale` and turned
    by `rotate` (roll, pitch, yaw [deg]) to stand; its size is measured. It collides as at most `parts` convex pieces.
    `articulated` is a model with joints, MJCF (.xml) or URDF (.urdf), whose origin the file chooses; its size is given.
    `cavity` (centre, half-extents [m], in the object's frame) is the free space inside a container of either kind.
    """

    kind: Literal["box", "cylinder", "open_box", "pan", "mug", "mesh", "articulated"]
    file: Annotated[Path, AfterValidator(_present)] | None = None
    scale: Scale = 1.0
    rotate: Degrees3 = (0.0, 0.0, 0.0)
    parts: Annotated[int, Field(ge=1, le=64, strict=True)] = 16
    size: Size3 = Field(default=None, validate_default=True)
    wall: Thickness | None = None
    floor: Thickness | None = None
    handle: tuple[Thickness, Thickness] | None = None
    cavity: tuple[Point3, Size3] | None = None

    @field_validator("size", mode="before")
    @classmethod
    def _measured(cls, size: Any, info: ValidationInfo) -> Any:
        """A mesh measures itself. A size that nothing says waits for the problem that is the reason."""
        if size is not None:
            return size
        if info.data.get("kind") != "mesh":
            raise PydanticCustomError("missing", "is missing")
        return measured(info.data).size if info.data.get("file") else (1.0, 1.0, 1.0)

    @model_validator(mode="after")
    def _consistent(self) -> Shape:
        ProblemsError.raise_any([*self._extras(), *self._room()])
        return self

    def _extras(self) -> Iterator[tuple[str, str]]:
        """Which keys there must and must not be for this kind."""
        for name, kinds in (("wall", HOLLOW), ("floor", HOLLOW), ("handle", HELD), ("file", FROM_FILE)):
            given = getattr(self, name) is not None
            if given and self.kind not in kinds:
                yield name, f"is for kinds {', '.join(kinds)}, not for {self.kind}"
            elif not given and self.kind in kinds:
                yield name, f"is missing, and needed for kind {self.kind}"
        if self.cavity is not None and self.kind not in FROM_FILE:
            yield "cavity", f"is for kinds {', '.join(FROM_FILE)}; a {self.kind} has one from its wall and floor"
        if self.kind in FROM_FILE and self.file is not None and self.file.suffix.lower() not in SUFFIXES[self.kind]:
            yield "file", f"{self.file.name!r} should end with {', '.join(SUFFIXES[self.kind])}"

    def _room(self) -> Iterator[tuple[str, str]]:
        """How much room the parts leave each other."""
        x, y, z = self.size
        if self.kind == "cylinder" and x != y:
            yield "size.0", f"{x:g} should be {y:g}, the y size: a cylinder is round"
        if self.kind in HELD and x <= y:
            yield "size.0", f"{x:g} should be greater than {y:g}, the width (y): the difference is the handle"
        across = y if self.kind in HELD else min(x, y)
        if self.wall is not None and 2 * self.wall >= across:
            yield "wall", f"{self.wall:g} should be less than {across / 2:g}, half of what it goes around"
        if self.floor is not None and self.floor >= z:
            yield "floor", f"{self.floor:g} should be less than {z:g}, the height"
        if self.handle is not None and self.handle[1] >= z:
            yield "handle.1", f"{self.handle[1]:g} should be less than {z:g}, the height"


def measured(shape: dict[str, Any]) -> Measured:
    """Size and volume of a mesh of a validated `file`, `scale` and `rotate`. Raises ValueError."""
    scale, rotate = shape.get("scale"), shape.get("rotate")
    if scale is None or rotate is None:  # which is a problem of its own
        return Measured((1.0, 1.0, 1.0), 1.0)
    return measure(shape["file"], scale, rotate)
