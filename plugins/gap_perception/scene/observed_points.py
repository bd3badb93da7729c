"""What all cameras together measured of what stands on the supports."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gap_runtime.contracts.types import Array

GRID_TOLERANCE = 0.004  # m: how far points of perfect frames may lie from a model's surface, since both are on grids
MAX_TOLERANCE = 0.012  # m: worse sensors than this are not believed
SIGMAS = 2.0


@dataclass(frozen=True)
class ObservedPoints:
    """Points on a grid: `points` (M, 3) [m], CIELAB `colours` (M, 3), height of the `support` below each (M,) [m].

    A point within `tolerance` [m] of a model's surface is explained by it.
    """

    points: Array
    colours: Array
    support: Array
    tolerance: float = GRID_TOLERANCE

    def select(self, index: Array) -> ObservedPoints:
        """The points at `index`."""
        return replace(self, points=self.points[index], colours=self.colours[index], support=self.support[index])


def surface_tolerance(noise: float, tilt: float) -> float:
    """The `tolerance` for sensors with depth `noise` [m] whose calibration was off by about `tilt` [m]."""
    return min(GRID_TOLERANCE + SIGMAS * noise + tilt, MAX_TOLERANCE)
