"""Task object models as Foxglove scene primitives, in the object's own frame."""

from __future__ import annotations

import math
from typing import Any

from foxglove import messages as fg

from gap_runtime.contracts.task import ObjectModel, Shape, rgb
from gap_runtime.contracts.task.container_geometry import body_centre, handle_bars

OPAQUE = 1.0
AROUND = 32  # sides a round wall is drawn with


def entity(name: str, model: ObjectModel, stamp: fg.Timestamp) -> fg.SceneEntity:
    """The object `name`, drawn in the frame of the same name."""
    r, g, b = (channel / 255 for channel in rgb(model.looks.base))
    tint = fg.Color(r=r, g=g, b=b, a=OPAQUE)
    draw = {"box": _box, "cylinder": _cylinder, "open_box": _open_box, "pan": _vessel, "mug": _vessel,
            "mesh": _box, "articulated": _box}  # fmt: skip
    return fg.SceneEntity(
        timestamp=stamp, frame_id=name, id=name, frame_locked=True, **draw[model.shape.kind](model.shape, tint),
        metadata=[fg.KeyValuePair(key="label", value=model.label)],
    )  # fmt: skip


def _box(shape: Shape, tint: fg.Color) -> dict[str, Any]:
    return {"cubes": [_cube((0, 0, 0), shape.size, tint)]}


def _cylinder(shape: Shape, tint: fg.Color) -> dict[str, Any]:
    return {"cylinders": [_disc((0, 0, 0), shape.size, tint)]}


def _open_box(shape: Shape, tint: fg.Color) -> dict[str, Any]:
    (x, y, z), wall, floor = shape.size, shape.wall or 0.0, shape.floor or 0.0
    cubes = [
        _cube((0, 0, (floor - z) / 2), (x, y, floor), tint),
        _cube(((x - wall) / 2, 0, 0), (wall, y, z), tint),
        _cube(((wall - x) / 2, 0, 0), (wall, y, z), tint),
        _cube((0, (y - wall) / 2, 0), (x, wall, z), tint),
        _cube((0, (wall - y) / 2, 0), (x, wall, z), tint),
    ]
    return {"cubes": cubes}


def _vessel(shape: Shape, tint: fg.Color) -> dict[str, Any]:
    """A pan or a mug: a disc for the floor, a tube for the wall, bars for the handle."""
    (_, width, height), wall, floor, x = shape.size, shape.wall or 0.0, shape.floor or 0.0, body_centre(shape)
    bars = [_cube(bar.centre, tuple(2 * h for h in bar.half), tint) for bar in handle_bars(shape)]
    tube = _tube(width / 2, width / 2 - wall, height)
    triangles = fg.TriangleListPrimitive(pose=_at(x, 0, 0), points=tube, indices=_faces(len(tube) // 4), color=tint)
    return {"cubes": bars, "triangles": [triangles],
            "cylinders": [_disc((x, 0, (floor - height) / 2), (width - wall, width - wall, floor), tint)]}  # fmt: skip


def _tube(outer: float, inner: float, height: float) -> list[fg.Point3]:
    """Four rings of points around z, one after the other: outer low, outer high, inner high, inner low."""
    rings = [(outer, -height / 2), (outer, height / 2), (inner, height / 2), (inner, -height / 2)]
    angles = [2 * math.pi * i / AROUND for i in range(AROUND)]
    return [fg.Point3(x=r * math.cos(a), y=r * math.sin(a), z=z) for r, z in rings for a in angles]


def _faces(count: int) -> list[int]:
    """Two triangles for every quad between a ring of `count` points and the next, the last ring joined to the first."""
    found: list[int] = []
    for ring in range(4):
        for i in range(count):
            a, b = ring * count + i, ring * count + (i + 1) % count
            c, d = (a + count) % (4 * count), (b + count) % (4 * count)
            found += [a, b, d, a, d, c]
    return found


def _disc(centre: tuple[float, ...], size: tuple[float, ...], tint: fg.Color) -> fg.CylinderPrimitive:
    x, y, z = size
    return fg.CylinderPrimitive(
        pose=_at(*centre), size=fg.Vector3(x=x, y=y, z=z), bottom_scale=1, top_scale=1, color=tint
    )


def _cube(centre: tuple[float, ...], size: tuple[float, ...], tint: fg.Color) -> fg.CubePrimitive:
    return fg.CubePrimitive(pose=_at(*centre), size=fg.Vector3(x=size[0], y=size[1], z=size[2]), color=tint)


def _at(x: float, y: float, z: float) -> fg.Pose:
    return fg.Pose(position=fg.Vector3(x=x, y=y, z=z), orientation=fg.Quaternion(x=0, y=0, z=0, w=1))
