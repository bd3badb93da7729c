"""The points of everything seen but the target: what a grasp has to keep clear of."""

from __future__ import annotations

from typing import Annotated

from gap_runtime.contracts.scripting import points_around
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, PointCloud, WorldConfig


def run(ctx: ScriptContext, world: WorldConfig) -> Annotated[PointCloud, WORLD]:
    """Points (N, 3) [m] of all obstacles that have some; supports have none."""
    return PointCloud(points_around(world))
