"""Round things one holds by a handle or a rim, a frying pan and a mug, as compounds of primitives."""

from __future__ import annotations

import numpy as np

from gap_cli.contracts.task import Shape
from gap_cli.contracts.types import Array
from gap_mujoco.parts import Part

STAVES = 24  # boxes a round wall is made of; their corners stick out of the circle by less than 1 %
OVERLAP = 0.01  # m a handle reaches into the wall it is fixed to, so that no gap shows
EAR = 0.75  # height of a mug's handle, as a share of the mug's


def vessel_parts(shape: Shape) -> list[Part]:
    """Floor, round wall and handle of a `pan` or a `mug`, whose handle points along x."""
    wall, floor = shape.wall or 0.0, shape.floor or 0.0
    radius, half_height = shape.size[1] / 2, shape.size[2] / 2
    x = body_centre(shape)
    parts = [Part("cylinder", (radius - wall / 2, floor / 2), (x, 0, -half_height + floor / 2))]
    parts += _staves(x, radius, wall, -half_height + floor, half_height)
    return parts + (_bar(shape) if shape.kind == "pan" else _ear(shape))


def body_centre(shape: Shape) -> float:
    """Where along the object's x axis the middle of the round part is [m]: the handle makes the rest of the length."""
    return (shape.size[1] - shape.size[0]) / 2


def vessel_cavity(shape: Shape) -> tuple[Array, Array]:
    """Centre and half-extents, in the object's frame, of the largest upright box that fits inside [m]."""
    wall, floor = shape.wall or 0.0, shape.floor or 0.0
    side = (shape.size[1] / 2 - wall) / np.sqrt(2)
    return np.array([body_centre(shape), 0, floor / 2]), np.array([side, side, (shape.size[2] - floor) / 2])


def _staves(x: float, radius: float, wall: float, low: float, high: float) -> list[Part]:
    """Upright boards around a circle, their outer faces touching it from inside."""
    middle = radius - wall / 2
    half = (wall / 2, (radius - wall) * np.tan(np.pi / STAVES), (high - low) / 2)
    return [
        Part("box", half, (x + middle * np.cos(a), middle * np.sin(a), (low + high) / 2), float(a))
        for a in 2 * np.pi * np.arange(STAVES) / STAVES
    ]


def _bar(shape: Shape) -> list[Part]:
    """A pan's handle: one bar level with the rim, from inside the wall to the end of the length."""
    width, thickness = shape.handle or (0.0, 0.0)
    start = body_centre(shape) + shape.size[1] / 2 - min(OVERLAP, shape.wall or 0.0)
    end = shape.size[0] / 2
    z = shape.size[2] / 2 - thickness / 2
    return [Part("box", ((end - start) / 2, width / 2, thickness / 2), ((start + end) / 2, 0, z))]


def _ear(shape: Shape) -> list[Part]:
    """A mug's handle: two bars that leave the wall and one that joins them."""
    width, thickness = shape.handle or (0.0, 0.0)
    start, end = body_centre(shape) + shape.size[1] / 2 - (shape.wall or 0.0), shape.size[0] / 2
    reach = EAR * shape.size[2] / 2 - thickness / 2
    bars = [
        Part("box", ((end - start) / 2, width / 2, thickness / 2), ((start + end) / 2, 0, z)) for z in (-reach, reach)
    ]
    return [*bars, Part("box", (thickness / 2, width / 2, reach), (end - thickness / 2, 0, 0))]
