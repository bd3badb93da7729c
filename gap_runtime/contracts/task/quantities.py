"""The quantities a task is made of, with their units and bounds; text and booleans are no numbers."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from gap_runtime.contracts.models import shown

_FINITE = {"strict": True, "allow_inf_nan": False}
Number = Annotated[float, Field(**_FINITE)]
Coordinate = Annotated[float, Field(ge=-100, le=100, **_FINITE)]  # m: a cell is smaller than this
Length = Annotated[float, Field(ge=0.001, le=10, **_FINITE)]  # m: of what a camera can see and physics can hold
Thickness = Annotated[float, Field(ge=0.0005, le=1, **_FINITE)]  # m: of a wall or a handle
Scale = Annotated[float, Field(ge=1e-6, le=1e6, **_FINITE)]  # of a mesh in any unit
Density = Annotated[float, Field(ge=1, le=25_000, **_FINITE)]  # kg/m^3
Mass = Annotated[float, Field(ge=0.0001, le=1000, **_FINITE)]  # kg
Friction = Annotated[float, Field(gt=0, le=10, **_FINITE)]
Degrees = Annotated[float, Field(ge=-360, le=360, **_FINITE)]
FieldOfView = Annotated[float, Field(gt=0, lt=180, **_FINITE)]  # deg
Pixels = Annotated[int, Field(ge=16, le=4096, strict=True)]  # per side of a picture
Weight = Annotated[float, Field(ge=0, **_FINITE)]
Seconds = Annotated[float, Field(gt=0, le=86_400, **_FINITE)]


def _numbers(count: int) -> BeforeValidator:
    """So that a list of the wrong length is one problem with its value, not one for each number."""

    def check(value: Any) -> Any:
        if not isinstance(value, list | tuple) or len(value) != count:
            raise ValueError(f"{shown(value)} should be a list of {count} numbers")
        return value

    return BeforeValidator(check)


Point2 = Annotated[tuple[Coordinate, Coordinate], _numbers(2)]  # m
Point3 = Annotated[tuple[Coordinate, Coordinate, Coordinate], _numbers(3)]  # m
Size2 = Annotated[tuple[Length, Length], _numbers(2)]  # m
Size3 = Annotated[tuple[Length, Length, Length], _numbers(3)]  # m
Degrees3 = Annotated[tuple[Degrees, Degrees, Degrees], _numbers(3)]
Resolution = Annotated[tuple[Pixels, Pixels], _numbers(2)]  # width, height


def _turns(quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not math.hypot(*quaternion) > 1e-6:
        raise ValueError(f"{list(quaternion)} should have a norm greater than 0")
    return quaternion


Rotation4 = Annotated[tuple[Number, Number, Number, Number], _numbers(4), AfterValidator(_turns)]  # w first


def _says_something(text: str) -> str:
    if not re.search(r"\w", text):
        raise ValueError(f"{text!r} should hold a letter or a digit")
    return text


Text = Annotated[str, Field(max_length=2000), AfterValidator(_says_something)]
Phrase = Annotated[str, Field(max_length=80), AfterValidator(_says_something)]  # what people call a thing
