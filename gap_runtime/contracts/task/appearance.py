"""How an object looks: what worlds draw and providers that render the models expect to see."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from gap_runtime.contracts.models import Document
from gap_runtime.contracts.task.quantities import Thickness

Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Style = Literal["plain", "can", "carton", "bottle", "box", "basket"]
Pattern = Literal["none", "letters", "disc", "stripes", "dots", "waves", "chevrons", "checks"]


class Appearance(Document):
    """`base` is the packaging's colour, `accent` that of the label's band and pattern, `ink` the print's.

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
    rim: Thickness | Literal[0] = 0


def rgb(colour: str) -> tuple[int, int, int]:
    """'#rrggbb' as (r, g, b), 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
