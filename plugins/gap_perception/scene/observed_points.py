"""What all cameras together measured of what stands on the supports."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gap_runtime.contracts.types import Array

EXACT = 0.004  # m: how far from a model's surface points of perfect frames may lie, for the grids on both sides
MOST = 0.012  # m: worse sensors than this are not believed
SIGMAS = 2.0


@dataclass(frozen=True)
class Measured:
    """Points on a grid: `points` (M, 3) [m], CIELAB `colours` (M, 3), height of the `support` below each (M,) [m].

    A point within `reach` [m] of a model's surface is explained by it.
    """

    points: Array
    colours: Array
    support: Array
    reach: float = EXACT

    def select(self, index: Array) -> Measured:
        """The points at `index`."""
        return replace(self, points=self.points[index], colours=self.colours[index], support=self.support[index])


def reach_of(noise: float, tilt: float) -> float:
    """`reach` for sensors with depth `noise` [m] whose calibration was off by about `tilt` [m]."""
    return min(EXACT + SIGMAS * noise + tilt, MOST)
