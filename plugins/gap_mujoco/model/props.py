"""One object of a task as MJCF: primitive collision geometry with its mass, and visual packaging."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from dm_control import mjcf

from gap_mujoco.model.files import build_articulated, build_mesh
from gap_mujoco.model.primitives import VISUAL_ONLY, CollisionPrimitive, contact_attributes
from gap_mujoco.model.vessels import vessel_cavity, vessel_primitives
from gap_mujoco.rendering.labels import draw_side, draw_top, draw_weave
from gap_mujoco.rendering.loft import Mesh, Section, face_widths, loft_cap, loft_side
from gap_runtime.contracts.task import Appearance, ObjectModel, Shape, rgb
from gap_runtime.contracts.types import Array

_CAP_SHARE = 0.62  # a bottle's cap, as a share of its narrower side


class Silhouette(NamedTuple):
    """How a style of packaging departs from its bounding box: the visual mesh's cross-sections, and the slabs
    that collide."""

    exponent: float
    sections: tuple[Section, ...]
    slabs: tuple[tuple[float, float, float, float], ...]  # z from, z to, share of x, share of y


_BOX = Silhouette(24, (Section(0), Section(1)), ((0, 1, 1, 1),))
_SILHOUETTES = {
    "can": Silhouette(
        2, (Section(0, 0.97, 0.97), Section(0.03), Section(0.97), Section(1, 0.97, 0.97)), ((0, 1, 1, 1),)
    ),
    "box": _BOX,
    "carton": Silhouette(
        24,
        (Section(0), Section(0.80), Section(0.93, 1, 0.12), Section(1, 1, 0.12)),
        ((0, 0.80, 1, 1), (0.80, 0.865, 1, 0.72), (0.865, 0.93, 1, 0.34), (0.93, 1, 1, 0.12)),
    ),
    "bottle": Silhouette(
        5,
        (Section(0, 0.95, 0.95), Section(0.02), Section(0.66), Section(0.74, 0.86, 0.86), Section(0.82, 0.55, 0.55)),
        ((0, 0.70, 1, 1), (0.70, 0.82, 0.70, 0.70)),
    ),
}


def build_object(name: str, model: ObjectModel) -> mjcf.RootElement:
    """MJCF of one object, its origin at the centre of its bounding box, its z axis up in the standing pose.

    Raises `DocumentError` when its file cannot be read.
    """
    if model.shape.kind == "articulated":
        return build_articulated(name, model)
    looks = model.looks
    root = mjcf.RootElement(model=name)
    root.compiler.angle = "radian"
    if model.shape.kind == "mesh":
        build_mesh(root, model, looks)
        return root
    primitives = collision_primitives(model.shape, looks)
    total = sum(p.volume for p in primitives)
    for primitive in primitives:
        root.worldbody.add(
            "geom", type=primitive.kind, size=primitive.size, pos=primitive.centre, quat=primitive.quaternion,
            mass=model.mass * primitive.volume / total, **contact_attributes(model),
        )  # fmt: skip
    _add_visuals(root, model.shape, looks, primitives)
    return root


def collision_primitives(shape: Shape, looks: Appearance) -> list[CollisionPrimitive]:
    """The collision geometry of a shape."""
    x, y, z = shape.size
    if shape.kind == "open_box":
        return _open_box(shape, looks.rim)
    if shape.kind in ("pan", "mug"):
        return vessel_primitives(shape)
    if shape.kind == "cylinder":
        return [CollisionPrimitive("cylinder", (x / 2, z / 2), (0, 0, 0))]
    primitives = []
    for low, high, sx, sy in _SILHOUETTES.get(looks.style, _BOX).slabs:
        half = (sx * x / 2, sy * y / 2, (high - low) * z / 2)
        primitives.append(CollisionPrimitive("box", half, (0, 0, ((low + high) / 2 - 0.5) * z)))
    if looks.style == "bottle":
        primitives.append(_cap(shape))
    return primitives


def cavity(shape: Shape) -> tuple[Array, Array]:
    """Centre and half-extents, in the object's frame, of the free space inside a container [m]."""
    if shape.cavity is not None:
        return np.array(shape.cavity[0]), np.array(shape.cavity[1])
    if shape.kind in ("pan", "mug"):
        return vessel_cavity(shape)
    x, y, z = shape.size
    wall, floor = shape.wall or 0.0, shape.floor or 0.0
    return np.array([0, 0, floor / 2]), np.array([x / 2 - wall, y / 2 - wall, (z - floor) / 2])


def _cap(shape: Shape) -> CollisionPrimitive:
    x, y, z = shape.size
    return CollisionPrimitive("cylinder", (_CAP_SHARE * min(x, y) / 2, 0.09 * z), (0, 0, 0.41 * z))


def _open_box(shape: Shape, rim: float) -> list[CollisionPrimitive]:
    """A floor, four walls, and, where `rim` sticks out, four strips around the top outside the walls."""
    x, y, z = (s / 2 for s in shape.size)
    wall, floor = shape.wall or 0.0, shape.floor or 0.0
    thick = (wall - rim) / 2
    ox, oy = x - rim, y - rim  # outer half sizes below the rim
    primitives = [CollisionPrimitive("box", (ox, oy, floor / 2), (0, 0, -z + floor / 2))]
    height = (2 * z - floor) / 2
    for s in (-1, 1):
        primitives.append(CollisionPrimitive("box", (thick, oy, height), (s * (ox - thick), 0, floor / 2)))
        primitives.append(CollisionPrimitive("box", (ox - 2 * thick, thick, height), (0, s * (oy - thick), floor / 2)))
    if rim:
        for s in (-1, 1):
            primitives.append(CollisionPrimitive("box", (rim / 2, y, rim / 2), (s * (x - rim / 2), 0, z - rim / 2)))
            primitives.append(CollisionPrimitive("box", (ox, rim / 2, rim / 2), (0, s * (y - rim / 2), z - rim / 2)))
    return primitives


def _add_visuals(root: mjcf.RootElement, shape: Shape, looks: Appearance, primitives: list[CollisionPrimitive]) -> None:
    """Add the visual geometry."""
    if looks.style == "basket":
        weave = _material(root, "weave", draw_weave(looks), cube=True)
        _add_visual_primitives(root, primitives[:5], material=weave)
        _add_visual_primitives(root, primitives[5:], rgba=_rgba(looks.cap))
    elif shape.handle is not None:
        grip = len(primitives) - (1 if shape.kind == "pan" else 3)
        _add_visual_primitives(root, primitives[:grip], rgba=_rgba(looks.base))
        _add_visual_primitives(root, primitives[grip:], rgba=_rgba(looks.accent))
    elif looks.style == "plain":
        _add_visual_primitives(root, primitives, rgba=_rgba(looks.base))
    else:
        _add_packaging(root, shape, looks)
        if looks.style == "bottle":
            _add_visual_primitives(root, [_cap(shape)], rgba=_rgba(looks.cap))


def _add_packaging(root: mjcf.RootElement, shape: Shape, looks: Appearance) -> None:
    silhouette = _SILHOUETTES[looks.style]
    side = draw_side(looks, face_widths(shape.size, silhouette.exponent), shape.size[2])
    lid = _material(root, "lid", draw_top(looks, shape.size[:2]))
    _mesh(root, "side", loft_side(shape.size, silhouette.sections, silhouette.exponent), _material(root, "side", side))
    _mesh(root, "top", loft_cap(shape.size, silhouette.sections[-1], silhouette.exponent, up=True), lid)
    _mesh(root, "bottom", loft_cap(shape.size, silhouette.sections[0], silhouette.exponent, up=False), lid)


def _mesh(root: mjcf.RootElement, name: str, mesh: Mesh, material: Any) -> None:
    asset = root.asset.add(
        "mesh", name=name, inertia="shell", vertex=mesh.vertices.ravel(), face=mesh.faces.ravel(),
        texcoord=mesh.texcoords.ravel(),
    )  # fmt: skip
    root.worldbody.add("geom", type="mesh", mesh=asset, material=material, **VISUAL_ONLY)


def _add_visual_primitives(root: mjcf.RootElement, primitives: list[CollisionPrimitive], **material: Any) -> None:
    for primitive in primitives:
        root.worldbody.add(
            "geom",
            type=primitive.kind,
            size=primitive.size,
            pos=primitive.centre,
            quat=primitive.quaternion,
            **material,
            **VISUAL_ONLY,
        )


def _material(root: mjcf.RootElement, name: str, image: Array, *, cube: bool = False) -> Any:
    ok, png = cv2.imencode(".png", image[:, :, ::-1])
    if not ok:
        raise RuntimeError(f"OpenCV could not encode the {name} texture")
    asset = mjcf.Asset(png.tobytes(), ".png")
    texture = root.asset.add("texture", name=name, type="cube" if cube else "2d", file=asset)
    return root.asset.add("material", name=name, texture=texture, specular=0.15, shininess=0.2)


def _rgba(colour: str) -> tuple[float, float, float, float]:
    r, g, b = rgb(colour)
    return r / 255, g / 255, b / 255, 1.0
