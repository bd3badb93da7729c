"""Round things one holds by a handle or a rim, a frying pan and a mug, as compounds of primitives."""

from __future__ import annotations

import numpy as np

from gap_mujoco.model.primitives import CollisionPrimitive
from gap_runtime.contracts.task import Shape
from gap_runtime.contracts.task.container_geometry import body_centre, handle_bars
from gap_runtime.contracts.types import Array

WALL_SEGMENTS = 24  # boxes a round wall is made of; their corners stick out of the circle by less than 1 %


def vessel_primitives(shape: Shape) -> list[CollisionPrimitive]:
    """Floor, round wall and handle of a `pan` or a `mug`, whose handle points along x."""
    wall, floor = shape.wall or 0.0, shape.floor or 0.0
    radius, half_height = shape.size[1] / 2, shape.size[2] / 2
    x = body_centre(shape)
    primitives = [CollisionPrimitive("cylinder", (radius - wall / 2, floor / 2), (x, 0, -half_height + floor / 2))]
    primitives += _wall_segments(x, radius, wall, -half_height + floor, half_height)
    return primitives + [CollisionPrimitive("box", bar.half, bar.centre) for bar in handle_bars(shape)]


def vessel_cavity(shape: Shape) -> tuple[Array, Array]:
    """Centre and half-extents, in the object's frame, of the largest upright box that fits inside [m]."""
    wall, floor = shape.wall or 0.0, shape.floor or 0.0
    side = (shape.size[1] / 2 - wall) / np.sqrt(2)
    return np.array([body_centre(shape), 0, floor / 2]), np.array([side, side, (shape.size[2] - floor) / 2])


def _wall_segments(x: float, radius: float, wall: float, low: float, high: float) -> list[CollisionPrimitive]:
    """Upright boxes around a circle, their outer faces touching it from inside."""
    middle = radius - wall / 2
    half = (wall / 2, (radius - wall) * np.tan(np.pi / WALL_SEGMENTS), (high - low) / 2)
    return [
        CollisionPrimitive("box", half, (x + middle * np.cos(a), middle * np.sin(a), (low + high) / 2), float(a))
        for a in 2 * np.pi * np.arange(WALL_SEGMENTS) / WALL_SEGMENTS
    ]
