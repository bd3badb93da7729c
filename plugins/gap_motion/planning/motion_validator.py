"""Straight joint motions as rows of configurations close enough together for collision checking."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gap_motion.collision.checker import CollisionChecker
from gap_runtime.contracts.types import Array

STEP = 0.025  # m: no point of the robot moves farther between checked configurations while planning
FIRST = 0.2  # rad between the configurations looked at first


class MotionValidator:
    """Checks straight joint motions: a few configurations first, then as many more as the robot moved between them."""

    def __init__(self, checker: CollisionChecker, step: float = STEP) -> None:
        self.checker, self.step = checker, step
        self.count = 0

    def free(self, start: Array, end: Array) -> bool:
        """True when no configuration on the way from start (n,) to end (n,) is in collision."""
        self.count += 1
        count = 2 + int(np.abs(end - start).max() / FIRST)
        s = np.linspace(0.0, 1.0, count)
        points = self.checker.probe(start + s[:, None] * (end - start))
        if points is None:
            return False
        moved = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1).max(axis=1))
        more = np.ceil(moved / self.step).astype(int) - 1
        between = [s[i] + (s[i + 1] - s[i]) * np.arange(1, n + 1) / (n + 1) for i, n in enumerate(more) if n > 0]
        if not between:
            return True
        return self.checker.free(start + np.concatenate(between)[:, None] * (end - start))

    def path_free(self, waypoints: Array) -> bool:
        """True when all segments of (M, n) waypoints are free."""
        return all(self.free(a, b) for a, b in pairwise(waypoints))
