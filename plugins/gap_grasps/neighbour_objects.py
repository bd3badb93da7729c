"""Which points are near which poses: a few hundred of each pose's own instead of all of them, as flat arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gap_runtime.contracts.types import Array

ELEMENTS = 2_000_000  # of a poses-by-points table looked at together: what fits the caches and the memory


class Nearby(NamedTuple):
    """Pairs of a pose and a point in the box around it, sorted by pose: indices (R,) and (R,), and the point in the
    pose's frame (R, 3), single precision."""

    pose: Array
    point: Array
    local: Array


def nearby(points: Array, T: Array, low: Array, high: Array) -> Nearby:
    """All points (N, 3) within the box from `low` to `high` (3,) of the frame of each pose T (K, 4, 4)."""
    points, T = points.astype(np.float32), T.astype(np.float32)
    poses, indices, locals_ = [], [], []
    batch = max(1, ELEMENTS // max(len(points), 1))
    for start in range(0, len(T), batch):
        R, p = T[start : start + batch, :3, :3], T[start : start + batch, :3, 3]
        origin = np.einsum("ki,kij->kj", p, R)
        axes = [R[:, :, axis] @ points.T - origin[:, axis, None] for axis in range(3)]
        inside = np.ones(axes[0].shape, dtype=bool)
        for axis, values in enumerate(axes):
            inside &= (values >= low[axis]) & (values <= high[axis])
        pose, point = np.nonzero(inside)
        poses.append(pose + start)
        indices.append(point)
        locals_.append(np.stack([values[pose, point] for values in axes], axis=1))
    if not poses:
        return Nearby(np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros((0, 3), dtype=np.float32))
    return Nearby(np.concatenate(poses), np.concatenate(indices), np.concatenate(locals_))
