"""Where body and handle of a pan or a mug are: what worlds build, providers look for and recordings show."""

from __future__ import annotations

from typing import NamedTuple

from gap_runtime.contracts.task import Shape

OVERLAP = 0.01  # m a pan's handle reaches into the wall it is fixed to, so that no gap shows
EAR = 0.75  # height of a mug's handle, as a share of the mug's


class Bar(NamedTuple):
    """A straight piece of a handle: its centre and its half sizes in the object's frame [m]."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]


def body_centre(shape: Shape) -> float:
    """Where along the object's x axis the middle of the round part is [m]: the handle makes the rest of the length."""
    return (shape.size[1] - shape.size[0]) / 2


def handle_bars(shape: Shape) -> list[Bar]:
    """The handle, which points along x: one bar level with a pan's rim, three around a mug's ear; none without one."""
    if shape.handle is None:
        return []
    (width, thickness), wall = shape.handle, shape.wall or 0.0
    start = body_centre(shape) + shape.size[1] / 2 - (min(OVERLAP, wall) if shape.kind == "pan" else wall)
    end = shape.size[0] / 2
    middle, half = (start + end) / 2, ((end - start) / 2, width / 2, thickness / 2)
    if shape.kind == "pan":
        return [Bar((middle, 0.0, shape.size[2] / 2 - thickness / 2), half)]
    reach = EAR * shape.size[2] / 2 - thickness / 2
    across = Bar((end - thickness / 2, 0.0, 0.0), (thickness / 2, width / 2, reach))
    return [Bar((middle, 0.0, -reach), half), Bar((middle, 0.0, reach), half), across]
