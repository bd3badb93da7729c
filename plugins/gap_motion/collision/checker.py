"""Collision checking of many configurations in one call: the robot's spheres against the scene and against itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gap_catalogue.curobo import COLLISION_MARGIN
from gap_catalogue.shared.robot_chain import Chain
from gap_motion.collision.sphere_batch import SphereBatch, sphere_batch
from gap_motion.collision.world import CollisionWorld
from gap_motion.kinematics.robot_model import RobotCollisionModel
from gap_runtime.contracts.types import Array

PIECE = 64  # configurations worked on at a time: what they need then stays in the processor's cache


@dataclass(frozen=True)
class Contact:
    """A contact: the configuration's index, the two things, and how deep they meet [m], the margin included."""

    index: int
    link: str
    other: str
    depth: float

    def __str__(self) -> str:
        return f"{self.link} with {self.other}, {max(self.depth, 0.0) * 1000:.0f} mm deep"


class Hits(NamedTuple):
    """Touching (configuration, part, obstacle) triples, shape (H,) each, and their depths [m]; ordered by the first."""

    rows: Array
    parts: Array
    obstacles: Array
    depths: Array


_NONE = np.zeros(0, dtype=int)
NO_HITS = Hits(_NONE, _NONE, _NONE, np.zeros(0))


@dataclass(eq=False)
class CollisionChecker:
    """One robot in one scene. `allowed[part, obstacle]` is how deep a part may go into an obstacle [m].

    The TCP must stay in the `workspace_box`, two corners (2, 3) in the world [m]. `checked` counts configurations, for
    benchmarks and budgets.
    """

    chain: Chain
    base: Array
    body: RobotCollisionModel
    world: CollisionWorld
    margin: float = COLLISION_MARGIN
    allowed: dict[tuple[int, int], float] = field(default_factory=dict)
    workspace_box: Array | None = None
    checked: int = 0

    def __post_init__(self) -> None:
        self._batch: SphereBatch = sphere_batch(self.body)
        self._base = self.base.astype(np.float32)
        slack = np.zeros((len(self.world.names), len(self.body.parts)))
        for (part, obstacle), depth in self.allowed.items():
            slack[obstacle, part] = depth
        self._bound = np.where(self._batch.fixed, -1.0, self._batch.reach + self.margin - slack).astype(np.float32)
        self._slack = slack
        self._is_box = np.array([i not in self.world.fields for i in range(len(self.world.names))], dtype=bool)
        self._radii = self._batch.radii

    def free(self, q: Array) -> bool:
        """True when none of the configurations (N, n) is in collision."""
        return all(self.probe(piece) is not None for piece in _pieces(q))

    def probe(self, q: Array) -> Array | None:
        """World positions (N, 3, columns) of the robot's spheres when all of (N, n) are free, else None; N is small."""
        points = self._place(q)
        if self.workspace_box is not None and self._outside(points).any():
            return None
        if any(hit.any() for _, hit in self._batch.overlaps(points)):
            return None
        return None if len(self._scene_hits(points).rows) else points

    def valid(self, q: Array) -> Array:
        """Which of the configurations (N, n) are free; shape (N,)."""
        return np.concatenate([self._valid(piece) for piece in _pieces(q)])

    def first_contact(self, q: Array) -> Contact | None:
        """A contact at the earliest configuration that has one, or None when all are free."""
        points = self._place(q)
        found, hits = [self._first_self(points)], self._scene_hits(points)
        if len(hits.rows):
            first = np.flatnonzero(hits.rows == hits.rows[0])
            at = int(first[np.argmax(hits.depths[first])])
            names = self.body.parts[hits.parts[at]].link, self.world.names[hits.obstacles[at]]
            found.append(Contact(int(hits.rows[at]), *names, float(hits.depths[at])))
        if self.workspace_box is not None and (outside := self._outside(points)).any():
            at = int(np.flatnonzero(outside)[0])
            found.append(Contact(at, "TCP", "the edge of the workspace", float(outside[at])))
        contacts = [c for c in found if c is not None]
        return min(contacts, key=lambda c: (c.index, -c.depth)) if contacts else None

    def penetrations(self, q: Array, parts: frozenset[int]) -> dict[tuple[int, int], float]:
        """How deep given parts are in each obstacle they touch at one configuration (n,)."""
        hits = self._scene_hits(self._place(q))
        found = zip(hits.parts, hits.obstacles, hits.depths, strict=True)
        return {(int(part), int(obstacle)): float(depth) for part, obstacle, depth in found if part in parts}

    def _place(self, q: Array) -> Array:
        q = np.atleast_2d(q)
        self.checked += len(q)
        return self._batch.place(self.chain, q, self._base)

    def _outside(self, points: Array) -> Array:
        """How far the TCP is outside the workspace box [m], 0 inside; shape (N,)."""
        assert self.workspace_box is not None
        tcp = points[:, :, -1]
        return np.asarray(
            np.maximum(np.maximum(self.workspace_box[0] - tcp, tcp - self.workspace_box[1]), 0.0).max(axis=1)
        )

    def _valid(self, q: Array) -> Array:
        points = self._place(q)
        bad = np.zeros(len(points), dtype=bool)
        for _, hit in self._batch.overlaps(points):
            bad |= hit.reshape(len(points), -1).any(axis=1)
        bad[self._scene_hits(points).rows] = True
        return ~bad if self.workspace_box is None else ~bad & (self._outside(points) == 0)

    def _first_self(self, points: Array) -> Contact | None:
        found = []
        for group, hit in self._batch.overlaps(points):
            if hit.any():
                index, a, b = (int(v) for v in np.argwhere(hit)[0])
                i, k = group.first[a], group.second[b]
                gap = float(np.linalg.norm(points[index, :, i] - points[index, :, k]))
                links = [self.body.parts[self._batch.part_of[column]].link for column in (i, k)]
                found.append(Contact(index, links[0], links[1], float(np.sqrt(group.touching[a, b])) - gap))
        return min(found, key=lambda c: c.index) if found else None

    def _scene_hits(self, points: Array) -> Hits:
        """Every part that touches an obstacle: configuration, part and obstacle, and how deep; in that order."""
        if not self.world.names:
            return NO_HITS
        near = self.world.bounds_distance(points[:, :, self._batch.bounding]) < self._bound
        rows, obstacles, parts = np.nonzero(near)
        gaps = np.full(len(rows), np.inf)
        for which, distances in self.world.fields.items():
            mine = np.flatnonzero(obstacles == which)
            if not len(mine):
                continue
            around = points[rows[mine], :, self._batch.bounding[parts[mine]]]
            mine = mine[distances.at_least(around) < self._bound[which, parts[mine]]]
            spheres = self._spheres(points, rows[mine], parts[mine])
            gaps[mine] = (distances.distance(spheres) - self._radii[parts[mine]]).min(axis=1)
        boxes = np.flatnonzero(self._is_box[obstacles])
        spheres = self._spheres(points, rows[boxes], parts[boxes])
        gaps[boxes] = (self.world.box_distance(spheres, obstacles[boxes]) - self._radii[parts[boxes]]).min(axis=1)
        depth = self.margin - self._slack[obstacles, parts] - gaps
        hit = np.flatnonzero(depth > 0)
        return Hits(rows[hit], parts[hit], obstacles[hit], depth[hit])

    def _spheres(self, points: Array, rows: Array, parts: Array) -> Array:
        """Centres of the spheres of (row, part) pairs (F,): shape (F, k, 3); shorter parts repeat theirs."""
        return points[rows[:, None], :, self._batch.columns[parts]]


def _pieces(q: Array) -> list[Array]:
    q = np.atleast_2d(q)
    return [q[i : i + PIECE] for i in range(0, len(q), PIECE)]
