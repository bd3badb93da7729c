"""Task object models as Foxglove scene primitives, in the object's own frame."""

from __future__ import annotations

from typing import Any

from foxglove import messages as fg

from gap_cli.contracts.task import ObjectModel

OPAQUE = 1.0


def entity(name: str, model: ObjectModel, stamp: fg.Timestamp) -> fg.SceneEntity:
    """The object `name`, drawn in the frame of the same name."""
    cubes, cylinders = _primitives(model)
    return fg.SceneEntity(
        timestamp=stamp, frame_id=name, id=name, frame_locked=True, cubes=cubes, cylinders=cylinders,
        metadata=[fg.KeyValuePair(key="label", value=model.label)],
    )  # fmt: skip


def color(looks: Any) -> fg.Color:
    """The base colour of an object's looks, `#rrggbb`; grey where it names none."""
    text = looks.get("base", "") if isinstance(looks, dict) else ""
    try:
        r, g, b = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    except (ValueError, TypeError):
        r = g = b = 0.6
    return fg.Color(r=r, g=g, b=b, a=OPAQUE)


def _primitives(model: ObjectModel) -> tuple[list[fg.CubePrimitive], list[fg.CylinderPrimitive]]:
    x, y, z = model.shape.size
    tint = color(model.looks)
    if model.shape.kind == "cylinder":
        shape = fg.CylinderPrimitive(pose=_at(0, 0, 0), size=fg.Vector3(x=x, y=y, z=z), bottom_scale=1, top_scale=1,
                                     color=tint)  # fmt: skip
        return [], [shape]
    if model.shape.kind == "box" or not model.shape.wall or not model.shape.floor:
        return [_cube((0, 0, 0), (x, y, z), tint)], []
    wall, floor = model.shape.wall, model.shape.floor
    return [
        _cube((0, 0, (floor - z) / 2), (x, y, floor), tint),
        _cube(((x - wall) / 2, 0, 0), (wall, y, z), tint),
        _cube(((wall - x) / 2, 0, 0), (wall, y, z), tint),
        _cube((0, (y - wall) / 2, 0), (x, wall, z), tint),
        _cube((0, (wall - y) / 2, 0), (x, wall, z), tint),
    ], []


def _cube(centre: tuple[float, float, float], size: tuple[float, float, float], tint: fg.Color) -> fg.CubePrimitive:
    return fg.CubePrimitive(pose=_at(*centre), size=fg.Vector3(x=size[0], y=size[1], z=size[2]), color=tint)


def _at(x: float, y: float, z: float) -> fg.Pose:
    return fg.Pose(position=fg.Vector3(x=x, y=y, z=z), orientation=fg.Quaternion(x=0, y=0, z=0, w=1))
