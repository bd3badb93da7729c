"""Plans where to set a held object down: the nearest place in reach that is level, free and large enough."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.scripting import held_corners, in_reach, points_around, tcp_pose
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, WorldConfig

GRID = 0.04  # m between places that are looked at
TURNS = np.radians([0, 45, -45, 90, -90, 135, -135, 180])  # about the vertical, from how it is held


class AsidePlan(NamedTuple):
    """Poses T_world_tcp: straight above the grasp, over the free place, where to let go, and clear of the object."""

    lift_pose: Annotated[Se3Pose, WORLD]
    carry_pose: Annotated[Se3Pose, WORLD]
    release_pose: Annotated[Se3Pose, WORLD]
    rise_pose: Annotated[Se3Pose, WORLD]


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    ee_pose_at_grasp: Annotated[Se3Pose, WORLD],
    world: WorldConfig,
    clearance: float = 0.06,
    gap: float = 0.003,
    margin: float = 0.03,
    retreat: float = 0.12,
) -> AsidePlan:
    """Plan the placement; supports are the obstacles without points. Raises `PlanningError` (`no_room`)."""

    def solve_ik(pose: Se3Pose) -> Any:
        return ctx.tool("pyroki.SolveIK", target_pose=pose)

    held = held_corners(target_obb, ee_pose_at_grasp)
    around = points_around(world)
    start, z = ee_pose_at_grasp.position.array[:2], ee_pose_at_grasp.position.z
    for centre, top in places(world, target_obb, start, ctx.robot().reach):
        for turn in TURNS:
            rotation = Rotation.from_euler("z", turn) * ee_pose_at_grasp.rotation.rotation
            corners = rotation.apply(held)
            middle, half = (corners.max(axis=0) + corners.min(axis=0)) / 2, np.ptp(corners, axis=0) / 2
            if (np.abs(around[:, :2] - centre) < half[:2] + margin).all(axis=1).any():
                continue
            xy, release_z = centre - middle[:2], top + gap - float(corners[:, 2].min())
            lift_z = max(release_z, z) + clearance
            lift = tcp_pose(start, lift_z, ee_pose_at_grasp.rotation.rotation)
            carry, release = tcp_pose(xy, lift_z, rotation), tcp_pose(xy, release_z, rotation)
            rise = tcp_pose(xy, release_z + retreat, rotation)
            if all(in_reach(solve_ik, pose) for pose in (release, carry, lift, rise)):
                return AsidePlan(lift, carry, release, rise)
    raise PlanningError("no_room", "There is no free place in reach to set the object down.", hint="Clear the support.")


def places(
    world: WorldConfig, target: OrientedBoundingBox, start: np.ndarray, reach: float
) -> list[tuple[np.ndarray, float]]:
    """Centres (2,) [m] on the supports and their heights [m], nearest to the object first, each a grid apart."""
    steps = np.arange(-reach, reach + GRID, GRID)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    offsets = offsets[np.argsort(np.linalg.norm(offsets, axis=1), kind="stable")]
    half = float(np.hypot(*target.extent.array[:2]))
    found = []
    for support in (o.box for o in world.obstacles if o.points is None):
        spots = target.center.array[:2] + offsets
        local = support.orientation.rotation.inv().apply(
            np.column_stack([spots, np.zeros(len(spots))]) - support.center.array
        )
        on_it = (np.abs(local[:, :2]) <= support.extent.array[:2] - half).all(axis=1)
        found += [(spot, float(support.corners[:, 2].max())) for spot in spots[on_it]]
    return sorted(found, key=lambda place: float(np.linalg.norm(place[0] - start)))
