"""The planner's scene for a planner with its own model of the arm: boxes and spheres in the base frame that give way.

Such a model's spheres are fatter in places than ours, and it knows no contact that is allowed: its base stands in the
table, and what is held touches what it stood on. So where the arm certainly may be, at the start and the goals, the
scene gives way: what is too near is grown less there, and what is touched is cut out. The motion is checked against
the whole scene afterwards, by our checker.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.world import DistanceField
from gap_runtime.contracts.types import Array

CLEAR = 0.001  # m left between a sphere and what was cut away for it
ASIDE = 0.03  # m more cut away beside it, so that it can leave in more than one direction


class Box(NamedTuple):
    """A box in the base frame: centre (3,), rows of its own axes (3, 3), half-extents (3,), and the most it may be
    grown [m]."""

    center: Array
    turn: Array
    half: Array
    most: float = np.inf


@dataclass
class PrimitiveScene:
    """Boxes, and spheres as rows of centre and radius (K, 4), all in the base frame, none grown."""

    boxes: list[Box]
    spheres: Array

    @classmethod
    def of(cls, checker: CollisionChecker) -> PrimitiveScene:
        """What is around the checker's arm."""
        world, base = checker.world, np.asarray(checker.base)
        boxes, spheres = [], []
        for i, (center, half) in enumerate(zip(world.centers, world.half, strict=True)):
            placed = (center - base[:3, 3]) @ base[:3, :3]
            if i in world.fields:
                boxes += list(solid_boxes(world.fields[i], base))
            elif half.any():
                boxes.append(Box(placed, world.to_local[i] @ base[:3, :3], half + world.rounding[i]))
            else:
                spheres.append([*placed, world.rounding[i]])
        return cls(boxes, np.array(spheres).reshape(-1, 4))

    def clear_start_contacts(self, spheres: Array, margin: float, aside: float = ASIDE) -> None:
        """Give way to spheres (S, 4) that move as one, so that all of it grown by `margin` does not touch them."""
        if not len(spheres):
            return
        for at in np.flatnonzero(self._near(spheres, margin))[::-1]:
            self.boxes += list(box_without(self.boxes.pop(at), spheres, margin, aside))
        if len(self.spheres):
            apart = np.linalg.norm(self.spheres[:, None, :3] - spheres[None, :, :3], axis=2) - spheres[:, 3]
            self.spheres[:, 3] = np.minimum(self.spheres[:, 3], apart.min(axis=1) - margin - CLEAR)
            self.spheres = self.spheres[self.spheres[:, 3] > 0]

    def _near(self, spheres: Array, margin: float) -> Array:
        """Which boxes, grown by `margin`, any of the spheres touches, shape (len(boxes),)."""
        if not self.boxes:
            return np.zeros(0, dtype=bool)
        middles, turns, halves, most = (np.array(rows) for rows in zip(*self.boxes, strict=True))
        local = np.einsum("bij,bsj->bsi", turns, spheres[None, :, :3] - middles[:, None])
        gaps = np.linalg.norm(np.maximum(np.abs(local) - halves[:, None], 0.0), axis=2) - spheres[:, 3]
        return np.asarray(gaps.min(axis=1) < np.minimum(margin, most) + CLEAR)


def box_without(box: Box, spheres: Array, margin: float, aside: float) -> Iterator[Box]:
    """A box that gives way to spheres that touch it when it is grown: at most seven boxes.

    Without the space of the spheres, and of `aside` [m] more across the direction in which they go least deep. If no
    sphere touches the box itself, that space stays a box, which may be grown less.
    """
    local = (spheres[:, :3] - box.center) @ box.turn.T
    gaps = np.linalg.norm(np.maximum(np.abs(local) - box.half, 0.0), axis=1) - spheres[:, 3]
    near = gaps < margin + CLEAR
    reach = spheres[near, 3, None] + margin + CLEAR
    low, high = (local[near] - reach).min(axis=0), (local[near] + reach).max(axis=0)
    across = np.arange(3) != np.argmin(np.minimum(high, box.half) - np.maximum(low, -box.half))
    low, high = low - aside * across, high + aside * across
    rest_low, rest_high = -box.half.copy(), box.half.copy()
    for axis in range(3):
        for start, end in ((rest_low[axis], low[axis]), (high[axis], rest_high[axis])):
            if end - start > 0:
                piece_low, piece_high = rest_low.copy(), rest_high.copy()
                piece_low[axis], piece_high[axis] = start, end
                yield _part(box, piece_low, piece_high, box.most)
        rest_low[axis], rest_high[axis] = max(rest_low[axis], low[axis]), min(rest_high[axis], high[axis])
    if gaps.min() > CLEAR:
        yield _part(box, rest_low, rest_high, min(box.most, float(gaps.min()) - CLEAR))


def _part(box: Box, low: Array, high: Array, most: float) -> Box:
    """The part of a box between two corners in its own frame."""
    return Box(box.center + (low + high) / 2 @ box.turn, box.turn, (high - low) / 2, most)


def solid_boxes(field: DistanceField, base: Array) -> Iterator[Box]:
    """The solid cells of a distance field as boxes: runs along z, joined along y, then along x where they are equal."""
    solid = np.pad(field.values < 0, ((0, 0), (0, 0), (1, 1))).astype(np.int8)
    i, j, low = np.nonzero(np.diff(solid, axis=2) > 0)
    high = np.nonzero(np.diff(solid, axis=2) < 0)[2]
    strips = _joined([(int(a), int(b), (int(c), int(d))) for a, b, c, d in zip(i, j, low, high, strict=True)])
    slabs = _joined([(j0, i, (j0, j1, k)) for i, j0, j1, k in strips])
    for _, i0, i1, (j0, j1, (k0, k1)) in slabs:
        first, last = np.array([i0, j0, k0]), np.array([i1, j1, k1])
        middle = field.origin + field.cell * ((first + last) / 2 - 0.5)
        yield Box((middle - base[:3, 3]) @ base[:3, :3], base[:3, :3], field.cell * (last - first) / 2)


def _joined(cells: Sequence[tuple[int, int, Any]]) -> list[tuple[int, int, int, Any]]:
    """(row, at, what) cells, joined where a row has equal ones next to each other: (row, from, to, what)."""
    out: list[tuple[int, int, int, Any]] = []
    for row, at, what in sorted(cells, key=lambda cell: (cell[0], cell[2], cell[1])):
        if out and out[-1][0] == row and out[-1][2] == at and out[-1][3] == what:
            out[-1] = (row, out[-1][1], at + 1, what)
        else:
            out.append((row, at, at + 1, what))
    return out
