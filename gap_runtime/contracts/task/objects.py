"""O and X of a task: the kinds of objects, and the joints of what is articulated."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import model_validator

from gap_runtime.contracts.models import Document
from gap_runtime.contracts.task.quantities import Positive


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
