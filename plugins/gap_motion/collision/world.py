"""The scene as collision checking sees it: boxes, cylinders, and distance fields around clouds and meshes.

Points come from cameras, which see surfaces from above. An obstacle is therefore what its points cover: every column
of its voxels is filled from its highest point down to its foot, so that a can is solid and a basket stays open.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gap_motion.collision.obstacle_shapes import check_shape, filled_mesh
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, Obstacle, OrientedBoundingBox, WorldConfig

VOXEL = 0.01  # m
TOUCH = 0.01  # m: how sizes and places of obstacles seen by a camera may be off
REACH = 0.15  # m around a field in which distances are known; farther away it counts as this far
MOST_POINTS = 5_000_000
MOST_CELLS = 300_000
SOLID = 0.9  # of a box filled by its points' columns: then the box itself is the better obstacle


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Distance to the surface [m], negative inside, on a grid whose first cell centre is at `origin`."""

    origin: Array
    cell: float
    values: Array

    def at_least(self, points: Array) -> Array:
        """A lower bound of the distance at points (N, 3), from the nearest cell alone; shape (N,)."""
        index = np.rint((points - self.origin) / self.cell).astype(np.intp)
        inside = np.asarray(np.all((index >= 0) & (index < self.values.shape), axis=1))
        i, j, k = np.where(inside[:, None], index, 0).T
        return np.where(inside, self.values[i, j, k], REACH) - 0.87 * self.cell

    def distance(self, points: Array) -> Array:
        """Distances (...,) at points (..., 3), linear between cells; `REACH` outside the grid."""
        from scipy.ndimage import map_coordinates

        at = ((points - self.origin) / self.cell).reshape(-1, 3).T
        values = map_coordinates(self.values, at, order=1, mode="constant", cval=REACH)
        return np.asarray(values.reshape(points.shape[:-1]))


@dataclass(frozen=True, eq=False)
class CollisionWorld:
    """Named obstacles: boxes by `centers` (M, 3), `half` (M, 3), `to_local` (M, 3, 3), grown all round by `rounding`
    (M,), so that a point is a sphere and a line a capsule. One that has a field (by its index) is what the field says,
    and its box is what contains it; one of the `cylinders` (M,) fills its box about its z axis."""

    names: tuple[str, ...]
    centers: Array
    half: Array
    to_local: Array
    rounding: Array
    fields: dict[int, DistanceField]
    cylinders: Array | None = None

    def box_distance(self, points: Array, which: Array) -> Array:
        """Signed distance from points (F, k, 3) to the boxes or cylinders `which` (F,): shape (F, k), single
        precision."""
        turn, half = self.to_local[which].astype(np.float32), self.half[which, None].astype(np.float32)
        local = (points - self.centers[which, None].astype(np.float32)) @ turn.transpose(0, 2, 1)
        if self.cylinders is not None and (of := self.cylinders[which]).any():
            local[of, :, 0] = np.hypot(local[of, :, 0], local[of, :, 1])
            local[of, :, 1] = 0.0
        np.abs(local, out=local)
        local -= half
        inside = np.minimum(local.max(axis=-1), 0.0)
        np.maximum(local, 0.0, out=local)
        rounding = self.rounding[which, None].astype(np.float32)
        return np.asarray(np.sqrt((local * local).sum(axis=-1)) + inside - rounding)

    def bounds_distance(self, points: Array) -> Array:
        """A lower bound of the distance from points (N, 3, L) to every obstacle: shape (N, M, L), single precision."""
        turn, shift, half, rounding = self._rows
        local = turn @ points
        local -= shift
        np.abs(local, out=local)
        local -= half
        np.maximum(local, 0.0, out=local)
        local *= local
        distance = np.sqrt(local.reshape(len(points), len(self.names), 3, -1).sum(axis=2))
        return np.asarray(distance - rounding)

    @cached_property
    def _rows(self) -> tuple[Array, Array, Array, Array]:
        """The boxes' axes, offsets along them and half sizes, one axis a row, and their roundings; single precision."""
        shift = np.einsum("mij,mj->mi", self.to_local, self.centers).reshape(-1, 1)
        rows = (self.to_local.reshape(-1, 3), shift, self.half.reshape(-1, 1), self.rounding[:, None])
        turn, shift, half, rounding = (row.astype(np.float32) for row in rows)
        return turn, shift, half, rounding


def make_world(config: WorldConfig | None, without: Collection[str] = ()) -> CollisionWorld:
    """The obstacles of a config, apart from the named ones.

    Raises `BadRequestError`: `not_finite`, `range` for a box without volume, `too_large` for too many points,
    `unknown_obstacle` for a name in `without` that no obstacle has.
    """
    obstacles = list(config.obstacles) if config is not None else []
    names = {o.name for o in obstacles}
    if missing := sorted(set(without) - names):
        raise unknown_obstacle(missing[0], names)
    kept = [_checked(o) for o in obstacles if o.name not in without]
    rotations = [o.box.orientation.rotation.as_matrix().T for o in kept]
    return CollisionWorld(
        tuple(o.name for o in kept),
        np.array([o.box.center.array for o in kept]).reshape(-1, 3),
        np.array([o.box.extent.array for o in kept]).reshape(-1, 3),
        np.array(rotations).reshape(-1, 3, 3),
        np.zeros(len(kept)),
        {i: f for i, o in enumerate(kept) if (f := _field(o)) is not None},
        np.array([o.cylinder for o in kept], dtype=bool) if any(o.cylinder for o in kept) else None,
    )


def unknown_obstacle(name: str, known: Collection[str]) -> BadRequestError:
    """The error of a name that no obstacle has (`unknown_obstacle`)."""
    listed = ", ".join(sorted(known)) or "none"
    return BadRequestError("unknown_obstacle", f"There is no obstacle {name!r}.", hint=f"Known: {listed}.")


def with_spheres(world: CollisionWorld, names: Sequence[str], centers: Array, radii: Array) -> CollisionWorld:
    """The scene and named spheres besides, centres (K, 3) and radii (K,) [m]."""
    count = len(names)
    return CollisionWorld(
        (*world.names, *names),
        np.concatenate([world.centers, centers]),
        np.concatenate([world.half, np.zeros((count, 3))]),
        np.concatenate([world.to_local, np.tile(np.eye(3), (count, 1, 1))]),
        np.concatenate([world.rounding, radii]),
        world.fields,
        None if world.cylinders is None else np.concatenate([world.cylinders, np.zeros(count, dtype=bool)]),
    )


def _field(obstacle: Obstacle) -> DistanceField | None:
    if obstacle.points is not None and obstacle.triangles is not None:
        return mesh_field(obstacle.points, obstacle.triangles)
    return None if obstacle.cylinder else field_of(obstacle.points, obstacle.box)


def field_of(points: Array | None, box: OrientedBoundingBox) -> DistanceField | None:
    """The distance field of points (N, 3) standing on the foot of `box`; None for no points, or when they fill it."""
    if points is None or not len(points):
        return None
    low = points.min(axis=0)
    foot = min(float(low[2]), float(box.corners[:, 2].min()))
    low = np.array([low[0], low[1], foot])
    cell = _cell(points.max(axis=0) - low)
    index = np.floor((points - low) / cell).astype(int)
    shape = index.max(axis=0) + 1
    heights = np.full(shape[:2], -1)
    np.maximum.at(heights, (index[:, 0], index[:, 1]), index[:, 2])
    filled = np.arange(shape[2]) <= heights[:, :, None]
    if filled.sum() * cell**3 >= SOLID * 8 * float(np.prod(box.extent.array)):
        return None
    return _distances(filled, low, cell)


def mesh_field(vertices: Array, triangles: Array) -> DistanceField:
    """The distance field of a mesh of `triangles` (F, 3) between `vertices` (N, 3), solid where it is closed."""
    used = vertices[np.unique(triangles)]
    low = used.min(axis=0)
    cell = _cell(used.max(axis=0) - low)
    return _distances(filled_mesh(vertices, triangles, low, cell), low, cell)


def _cell(size: Array) -> float:
    """How large the cells of a field are around something of that size (3,) [m]."""
    return max(VOXEL, float(np.cbrt(np.prod(size + 2 * REACH) / MOST_CELLS)))


def _distances(filled: Array, low: Array, cell: float) -> DistanceField:
    from scipy.ndimage import distance_transform_edt

    margin = int(np.ceil(REACH / cell))
    solid = np.pad(filled, margin)
    outside = distance_transform_edt(~solid)
    inside = distance_transform_edt(solid)
    values = np.where(solid, 0.5 - inside, outside - 0.5) * cell
    origin = low + (0.5 - margin) * cell
    return DistanceField(origin, cell, np.minimum(values, REACH).astype(np.float32))


def _checked(obstacle: Obstacle) -> Obstacle:
    box, name = obstacle.box, obstacle.name
    if not np.isfinite([*box.center.array, *box.extent.array]).all():
        raise BadRequestError("not_finite", f"Obstacle {name!r} has a box that is not finite.")
    if (box.extent.array < 0).any():
        raise BadRequestError("range", f"Obstacle {name!r} has a negative extent {box.extent}.")
    if obstacle.points is not None and len(obstacle.points) > MOST_POINTS:
        raise BadRequestError(
            "too_large",
            f"Obstacle {name!r} has {len(obstacle.points)} points; at most {MOST_POINTS} are taken.",
            hint="Thin it to a voxel grid; geometry_svc.BuildWorldConfig does.",
        )
    if obstacle.points is not None and not np.isfinite(obstacle.points).all():
        raise BadRequestError("not_finite", f"Obstacle {name!r} has points that are not finite.")
    check_shape(obstacle)
    return obstacle


def graspable(config: WorldConfig | None, grasps: Array, width: float) -> list[str]:
    """Names of the obstacles that any of the TCP poses (K, 4, 4) grasps.

    The TCP is within `TOUCH` of the obstacle's box, and the box fits between jaws `width` [m] open.
    """
    found = []
    for obstacle in config.obstacles if config is not None else ():
        box, turn = obstacle.box, obstacle.box.orientation.rotation.as_matrix().T
        near = (np.abs((grasps[:, :3, 3] - box.center.array) @ turn.T) <= box.extent.array + TOUCH).all(axis=1)
        across = np.abs(grasps[:, :3, 1] @ turn.T) @ box.extent.array  # half the box along the closing direction
        if (near & (2 * across <= width + 2 * TOUCH)).any():
            found.append(obstacle.name)
    return found
