"""Where a body's spheres are for many configurations at once, and which of them overlap each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_motion.kinematics.robot_model import SMALL, STATIC, RobotCollisionModel
from gap_runtime.contracts.types import Array


class SelfGroup(NamedTuple):
    """Columns (A,) and (B,) compared with each other: squared distances at which they touch (A, B), -1 for never."""

    first: Array
    second: Array
    touching: Array


@dataclass(frozen=True, eq=False)
class SphereBatch:
    """One column per sphere and per part, for all configurations, and a last one for the TCP: what checks work on.

    `blocks` are (frame, columns, homogeneous centres (4, k)); `spheres[part]` and `bounding[part]` are columns.
    `columns` and `radii` (P, k) are the spheres' again, in one table: shorter parts repeat theirs. `reach` (P,) [m] is
    a part's.
    """

    blocks: tuple[tuple[int, slice, Array], ...]
    count: int
    spheres: tuple[Array, ...]
    bounding: Array
    columns: Array
    radii: Array
    reach: Array
    fixed: Array
    groups: tuple[SelfGroup, ...]
    part_of: Array

    def place(self, chain: Chain, q: Array, base: Array) -> Array:
        """World positions of all columns, the TCP's last, shape (N, 3, count + 1), single precision."""
        frames = chain.frames(q.astype(np.float32), base)
        out = np.empty((len(q), 3, self.count + 1), dtype=np.float32)
        out[:, :, -1] = frames[-1, :, :3] @ chain.tcp[:, 3].astype(np.float32)
        for frame, where, centers in self.blocks:
            if frame == STATIC:
                out[:, :, where] = (base @ centers)[:3]
            else:
                placed = frames[frame].reshape(-1, 4) @ centers
                out[:, :, where] = placed.reshape(len(q), 4, -1)[:, :3]
        return out

    def overlaps(self, points: Array) -> Iterator[tuple[SelfGroup, Array]]:
        """For every group, which of its columns overlap, (N, A, B): |a - b|^2 = (-2a, |a|^2, 1) (b, 1, |b|^2)."""
        points = points[:, :, : self.count]
        left, right = (np.empty((len(points), 5, self.count), dtype=np.float32) for _ in range(2))
        squares = np.einsum("nic,nic->nc", points, points)
        np.multiply(points, -2.0, out=left[:, :3])
        left[:, 3], left[:, 4] = squares, 1.0
        right[:, :3], right[:, 3], right[:, 4] = points, 1.0, squares
        for group in self.groups:
            yield group, (left[:, :, group.first].transpose(0, 2, 1) @ right[:, :, group.second]) < group.touching


@lru_cache(maxsize=64)
def sphere_batch(body: RobotCollisionModel) -> SphereBatch:
    """A body laid out frame by frame, so that every frame's columns are next to each other; done once per body."""
    blocks, column, part_of = [], 0, []
    spheres, bounding = [np.zeros(0, dtype=int)] * len(body.parts), np.zeros(len(body.parts), dtype=int)
    for frame in sorted({part.frame for part in body.parts}):
        start, rows = column, []
        for i, part in enumerate(body.parts):
            if part.frame == frame:
                spheres[i] = np.arange(column, column + len(part.radii))
                bounding[i] = column + len(part.radii)
                rows += [*part.centers, part.middle]
                column += len(part.radii) + 1
                part_of += [i] * (len(part.radii) + 1)
        centers = np.concatenate([np.array(rows).T, np.ones((1, len(rows)))]).astype(np.float32)
        blocks.append((frame, slice(start, column), centers))
    most = max(len(part.radii) for part in body.parts)
    padded = [np.resize(np.arange(len(part.radii)), most) for part in body.parts]
    return SphereBatch(
        tuple(blocks),
        column,
        tuple(spheres),
        bounding,
        columns=np.array([s[k] for s, k in zip(spheres, padded, strict=True)]),
        radii=np.array([part.radii[k] for part, k in zip(body.parts, padded, strict=True)], dtype=np.float32),
        reach=np.array([part.reach for part in body.parts]),
        fixed=np.array([part.frame == STATIC for part in body.parts]),
        groups=tuple(_groups(body, tuple(spheres), bounding)),
        part_of=np.array(part_of),
    )


def _groups(body: RobotCollisionModel, spheres: tuple[Array, ...], bounding: Array) -> list[SelfGroup]:
    """Few dense comparisons that cover all pairs: split at the joint that most pairs lie across, then the rest."""
    rest, out = {(int(a), int(b)) for a, b in body.pairs}, []
    frame = [part.frame for part in body.parts]
    while rest:
        across = {
            cut: {(a, b) for a, b in rest if min(frame[a], frame[b]) <= cut < max(frame[a], frame[b])}
            for cut in range(STATIC, max(frame))
        }
        best = max(sorted(across), key=lambda cut: len(across[cut]))
        out.append(_group(body, across[best], best, spheres, bounding))
        rest -= across[best]
    return out


def _group(
    body: RobotCollisionModel, pairs: set[tuple[int, int]], cut: int, spheres: tuple[Array, ...], bounding: Array
) -> SelfGroup:
    members = sorted({i for pair in pairs for i in pair})
    low = [i for i in members if body.parts[i].frame <= cut]
    high = [i for i in members if body.parts[i].frame > cut]
    (first, r1, part1), (second, r2, part2) = (_columns(body, side, spheres, bounding) for side in (low, high))
    wanted = pairs | {(b, a) for a, b in pairs}
    mask = np.array([[(a, b) in wanted for b in part2] for a in part1])
    return SelfGroup(first, second, np.where(mask, (r1[:, None] + r2) ** 2, -1.0).astype(np.float32))


def _columns(
    body: RobotCollisionModel, side: list[int], spheres: tuple[Array, ...], bounding: Array
) -> tuple[Array, Array, list[int]]:
    """Columns, radii and owning parts of one side; a small part stands for its spheres."""
    columns, radii, owners = [], [], []
    for i in side:
        part = body.parts[i]
        small = part.reach <= SMALL
        columns += [bounding[i : i + 1]] if small else [spheres[i]]
        radii += [part.reach] if small else list(part.radii)
        owners += [i] * (1 if small else len(part.radii))
    return np.concatenate(columns), np.array(radii), owners
