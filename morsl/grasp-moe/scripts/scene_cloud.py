"""The points of everything seen but the target: what a grasp has to keep clear of."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from gap_cli.contracts.tool import ScriptContext
from gap_cli.contracts.types import WORLD, PointCloud, WorldConfig


def run(ctx: ScriptContext, world: WorldConfig) -> Annotated[PointCloud, WORLD]:
    """Points (N, 3) [m] of all obstacles that have some; supports have none."""
    clouds = [o.points for o in world.obstacles if o.points is not None and o.name != "target"]
    return PointCloud(np.concatenate([np.zeros((0, 3)), *clouds]))
