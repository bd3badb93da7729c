"""Reads an object's mesh file, scaled and turned to stand, its origin at the centre of its bounding box."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation


class Measured(NamedTuple):
    """Full size [m] of the bounding box, and the volume [m^3] of the solid (of its convex hull where it has holes)."""

    size: tuple[float, float, float]
    volume: float


@lru_cache(maxsize=64)
def load_mesh(file: Path, scale: float, rotate: tuple[float, float, float]) -> Any:
    """The `trimesh.Trimesh`, in metres; a scene is joined into one mesh. Raises ValueError where it cannot be read."""
    try:
        import trimesh
    except ImportError:
        raise ValueError("a mesh needs the package trimesh. Run: pip install trimesh") from None
    try:
        mesh = trimesh.load_mesh(str(file), process=False)
    except Exception as error:  # readers of many formats raise what they like
        raise ValueError(f"{file.name} cannot be read as a mesh: {error}") from None
    if not len(getattr(mesh, "faces", ())) or not np.isfinite(mesh.vertices).all():
        raise ValueError(f"{file.name} holds no triangles, or vertices that are not finite")
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", rotate, degrees=True).as_matrix() * scale
    mesh.apply_transform(turn)
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


@lru_cache(maxsize=64)
def load_solid(file: Path, scale: float, rotate: tuple[float, float, float]) -> Any:
    """The same mesh without its looks, vertices of one place merged: what has a volume and collides."""
    solid = load_mesh(file, scale, rotate).copy(include_visual=False)
    solid.merge_vertices(merge_tex=True, merge_norm=True)
    return solid


def measure(file: Path, scale: float, rotate: tuple[float, float, float]) -> Measured:
    """Its size and volume. Raises ValueError."""
    mesh = load_solid(file, float(scale), tuple(map(float, rotate)))
    x, y, z = (float(e) for e in mesh.extents)
    return Measured((x, y, z), abs(float(mesh.volume if mesh.is_watertight else mesh.convex_hull.volume)))
