"""O and X of a task: the kinds of objects, and the joints of what is articulated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from gap_runtime.contracts.models import Document, ProblemsError
from gap_runtime.contracts.names import Identifier
from gap_runtime.contracts.task.appearance import Appearance
from gap_runtime.contracts.task.quantities import Density, Friction, Mass, Number, Phrase, Point3, Size3
from gap_runtime.contracts.task.shape import HOLLOW, Shape, measured

PACKAGING = ("can", "carton", "bottle", "box")  # styles that are wrapped around a closed shape


def _spoken(text: str) -> str:
    if "." in text:
        raise ValueError(f"{text!r} should hold no full stop, which separates the phrases a detector looks for")
    return text


class Part(Document):
    """A named part of an object: the upright box that holds it, by its centre and size [m] in the object's frame."""

    center: Point3
    size: Size3
    words: list[Phrase] = []


class ObjectModel(Document):
    """O: one kind of object. The id (its key in the task) is its name everywhere; `words` are other names for it.

    A mesh may be given a `density` [kg/m^3] instead of its mass. A `fixed` object is bolted down where its instance
    puts it; an articulated one always is. `accepts` lists the ids and categories that may be put into it; `*` stands
    for anything. `parts` are places on it that a graph may ask for by name, such as a knob.
    """

    label: Annotated[Phrase, AfterValidator(_spoken)]
    words: list[Phrase] = []
    category: Phrase = "object"
    shape: Shape
    density: Density | None = None
    mass: Mass = Field(default=None, validate_default=True)
    fixed: bool = Field(default=False, validate_default=True)
    friction: Friction = 0.9
    looks: Appearance = Appearance()
    accepts: list[Phrase | Literal["*"]] = []
    parts: dict[Identifier, Part] = {}

    @field_validator("mass", mode="before")
    @classmethod
    def _weighed(cls, mass: Any, info: ValidationInfo) -> Any:
        """A mesh of known density weighs itself, and the links of an articulated object have masses of their own."""
        shape, density = info.data.get("shape"), info.data.get("density")
        if density is not None and (mass is not None or (shape is not None and shape.kind != "mesh")):
            raise ValueError("should not stand beside density, which is for kind mesh in place of mass")
        if mass is not None or shape is None or shape.kind == "articulated":
            return 1.0 if mass is None else mass
        if density is None:
            raise PydanticCustomError("missing", "is missing")
        return density * measured(vars(shape)).volume

    @field_validator("fixed", mode="after")
    @classmethod
    def _bolted(cls, fixed: bool, info: ValidationInfo) -> bool:
        return fixed or ("shape" in info.data and info.data["shape"].kind == "articulated")

    @model_validator(mode="after")
    def _dressed(self) -> ObjectModel:
        ProblemsError.raise_any(self._undressed())
        return self

    def _undressed(self) -> Iterator[tuple[str, str]]:
        """Where looks and shape do not go together."""
        style, kind, rim, texture = self.looks.style, self.shape.kind, self.looks.rim, self.looks.texture
        if style in PACKAGING and kind in HOLLOW:
            yield "looks.style", f"{style!r} is for closed shapes, not for kind {kind}"
        if style == "basket" and kind != "open_box":
            yield "looks.style", f"'basket' is for kind open_box, not for {kind}"
        if rim and kind != "open_box":
            yield "looks.rim", f"{rim:g} is for kind open_box, not for {kind}"
        elif rim and self.shape.wall is not None and rim >= self.shape.wall:
            yield "looks.rim", f"{rim:g} should be less than {self.shape.wall:g}, the wall that it is part of"
        if texture and kind != "mesh":
            yield "looks.texture", f"{texture!r} is for kind mesh, not for {kind}"
        elif texture and self.shape.file is not None and not (self.shape.file.parent / texture).is_file():
            yield "looks.texture", f"{texture!r} is not there (looked in {self.shape.file.parent})"

    @property
    def is_container(self) -> bool:
        """True when things can be put into it."""
        return bool(self.accepts)


class Joint(Document):
    """X: one articulated degree of freedom [rad or m]."""

    range: tuple[Number, Number]
    initial: Number = 0.0

    @model_validator(mode="after")
    def _inside(self) -> Joint:
        low, high = self.range
        if not low < high:
            raise ProblemsError([("range", f"{low:g} should be less than {high:g}")])
        if not low <= self.initial <= high:
            raise ProblemsError([("initial", f"{self.initial:g} should be within [{low:g}, {high:g}]")])
        return self
