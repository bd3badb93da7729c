"""The sphere model of a robot: read from its file, or made by covering the collision shapes of its MJCF.

`python -m gap_robots.spheres MODEL.xml OUT.json` writes the file; a test keeps file and model together.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gap_runtime.contracts.robot import CollisionSphere
from gap_runtime.contracts.types import Array

SPACING = 0.9  # of the radius of a capsule, between centres: the spheres then stick out by at most 10 % of it
CELL = 0.011  # m: a box is cut into cells of about this size, but never into more than MAX_CELLS along an axis
MAX_CELLS = 2
MESH_CELL = 0.035  # m: a mesh is covered by spheres around cells of about this size


def read_spheres(path: Path) -> tuple[CollisionSphere, ...]:
    """From JSON: {link: [[x, y, z, radius], ...]} in the link's frame [m]."""
    data: dict[str, list[list[float]]] = json.loads(path.read_text())
    return tuple(CollisionSphere(link, (x, y, z), r) for link, rows in data.items() for x, y, z, r in rows)


def cover_model(model_file: Path) -> dict[str, list[list[float]]]:
    """Spheres that contain every collision geom of an MJCF, by body: [[x, y, z, radius], ...] in its frame [m]."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(model_file))
    out: dict[str, list[list[float]]] = {}
    for geom in range(model.ngeom):
        if model.geom_contype[geom] or model.geom_conaffinity[geom]:
            centers, radius = _cover_geom(model, geom)
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
            centers = centers @ rotation.reshape(3, 3).T + model.geom_pos[geom]
            rows = out.setdefault(model.body(model.geom_bodyid[geom]).name, [])
            rows += [[*(round(float(v), 5) for v in c), math.ceil(radius * 1e5) / 1e5] for c in centers]
    return out


def _cover_geom(model: Any, geom: int) -> tuple[Array, float]:
    """Centres (N, 3) in the geom frame and their common radius."""
    import mujoco

    kind, size = mujoco.mjtGeom(model.geom_type[geom]), np.array(model.geom_size[geom])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return cover_capsule(float(size[0]), float(size[1]))
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return cover_box(np.array([size[0], size[0], size[1]]))
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return cover_mesh(model, geom)
    return cover_box(size[:3])


def cover_capsule(radius: float, half_length: float) -> tuple[Array, float]:
    """A row of spheres along z that contains the capsule."""
    n = 1 + math.ceil(2 * half_length / (SPACING * radius))
    z = np.linspace(-half_length, half_length, n)
    gap = 2 * half_length / (n - 1) if n > 1 else 0.0
    return np.column_stack([np.zeros(n), np.zeros(n), z]), math.hypot(radius, gap / 2)


def cover_box(half: Array) -> tuple[Array, float]:
    """A grid of spheres that contains the box: each contains one cell."""
    counts = np.clip(np.ceil(2 * half / CELL), 1, MAX_CELLS).astype(int)
    cell = half / counts
    axes = [np.linspace(-h + c, h - c, n) for h, c, n in zip(half, cell, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3), float(np.linalg.norm(cell))


def cover_mesh(model: Any, geom: int) -> tuple[Array, float]:
    """A grid of spheres over a mesh's bounding box, without those that its convex hull does not reach."""
    from scipy.spatial import ConvexHull

    center, half = np.array(model.geom_aabb[geom, :3]), np.array(model.geom_aabb[geom, 3:])
    counts = np.clip(np.ceil(2 * half / MESH_CELL), 1, 8).astype(int)
    cell = half / counts
    axes = [np.linspace(-h + c, h - c, n) for h, c, n in zip(half, cell, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3) + center
    radius = float(np.linalg.norm(cell))
    mesh = model.geom_dataid[geom]
    first, many = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    planes = ConvexHull(np.array(model.mesh_vert[first : first + many], dtype=float)).equations
    reached = (grid @ planes[:, :3].T + planes[:, 3]).max(axis=1) <= radius
    return grid[reached], radius


def main(model_file: str, out_file: str) -> None:
    """Write the sphere model of an MJCF file."""
    rows = cover_model(Path(model_file))
    lines = ",\n".join(f" {json.dumps(link)}: {json.dumps(spheres)}" for link, spheres in rows.items())
    Path(out_file).write_text("{\n" + lines + "\n}\n")


if __name__ == "__main__":
    main(*sys.argv[1:3])
