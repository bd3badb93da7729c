"""How an object of a task looks: the part of `ObjectModel.looks` this world understands, checked."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from gap_runtime.contracts.models import Document

Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Style = Literal["plain", "can", "carton", "bottle", "box", "basket"]
Pattern = Literal["none", "letters", "disc", "stripes", "dots", "waves", "chevrons", "checks"]


class Looks(Document):
    """Appearance. `base` is the packaging's colour, `accent` that of the label's band and pattern, `ink` the print's.

    texture picture of a mesh, in place of the file's own; a path beside the mesh
    text    what is printed on the label, one entry per line
    cap     colour of the cap, lid or metal; also of a basket's rim
    rim     how far the rim of an open box sticks out beyond its walls [m]
    """

    style: Style = "plain"
    base: Colour = "#b0b4ba"
    accent: Colour = "#5b6270"
    ink: Colour = "#ffffff"
    cap: Colour = "#d9dbe0"
    pattern: Pattern = "none"
    text: list[str] = []
    texture: str = ""
    rim: Annotated[float, Field(ge=0)] = 0.0

    @classmethod
    def of(cls, looks: dict[str, Any], name: str) -> Looks:
        """Read the `looks` of object `name`. Raises `DocumentError`."""
        return cls.load(looks, f"objects.{name}.looks")


def rgb(colour: str) -> tuple[int, int, int]:
    """'#rrggbb' as (r, g, b), 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
