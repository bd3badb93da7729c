"""What the robots of a task must agree with: their own limits, each other's bases, and the names of the cameras."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.robot import CameraSpec, RobotSpec
from gap_runtime.contracts.task.cell import RobotPlacement
from gap_runtime.contracts.types import Array

Placed = tuple[RobotPlacement, RobotSpec]


class MountedCamera(NamedTuple):
    """A camera on arm `arm`, and its name in the cell."""

    name: str
    arm: int
    spec: CameraSpec


def mounted_cameras(robots: Sequence[RobotSpec]) -> list[MountedCamera]:
    """The robots' own cameras; where there are several robots, their names end with the arm's number."""
    return [
        MountedCamera(camera.name if len(robots) == 1 else f"{camera.name}_{arm}", arm, camera)
        for arm, robot in enumerate(robots)
        for camera in robot.cameras
    ]


def home_problems(placement: RobotPlacement, spec: RobotSpec) -> Iterator[tuple[str, str]]:
    """Where a home pose is not one of this robot."""
    home = placement.home
    if home is None:
        return
    if len(home) != spec.dof:
        yield "home", f"{list(home)} should be {spec.dof} joint positions, as {spec.name} has, not {len(home)}"
        return
    for i, (name, value, limit) in enumerate(zip(spec.joints, home, spec.limits, strict=True)):
        if not limit.lower <= value <= limit.upper:
            yield f"home.{i}", f"{value:g} should be within [{limit.lower:g}, {limit.upper:g}] rad, the range of {name}"


def base_problems(placed: Sequence[Placed]) -> Iterator[tuple[str, str]]:
    """Where the bases of two robots overlap; a base without a shape is a point."""
    spheres = [_base_spheres(*one) for one in placed]
    for (i, (a, r)), (j, (b, s)) in combinations(enumerate(spheres), 2):
        overlap = float((r[:, None] + s - cdist(a, b)).max())
        if overlap >= 0:
            here, there = (list(placed[k][0].position) for k in (j, i))
            far = f"farther from robots.{i} at {there}: their bases overlap by {1000 * overlap:.0f} mm"
            yield f"{j}.position", f"{here} should be {far}"


def _base_spheres(placement: RobotPlacement, spec: RobotSpec) -> tuple[Array, Array]:
    """Centres (N, 3) in the world and radii (N) of the spheres of the base [m]."""
    rows = [(*s.center, s.radius) for s in spec.spheres if s.link == spec.base_link] or [(0.0, 0.0, 0.0, 0.0)]
    data, turn = np.array(rows), Rotation.from_euler("z", placement.yaw_deg, degrees=True)
    return turn.apply(data[:, :3]) + placement.position, data[:, 3]
