"""Plans how to set a held object down: its box's centre over the support's, as high as it hangs, turned least."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.scripting import held_corners, in_reach, tcp_pose
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose

TURNS = np.radians([0, 20, -20, 45, -45, 70, -70, 90, -90, 135, -135, 180])  # about the vertical, from how it is held


class PlacePlan(NamedTuple):
    """Poses T_world_tcp: straight above the grasp, over the support, where to let go, and clear of the object."""

    lift_pose: Annotated[Se3Pose, WORLD]
    carry_pose: Annotated[Se3Pose, WORLD]
    release_pose: Annotated[Se3Pose, WORLD]
    rise_pose: Annotated[Se3Pose, WORLD]


def run(
    ctx: ScriptContext,
    support_obb: Annotated[OrientedBoundingBox, WORLD],
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    ee_pose_at_grasp: Annotated[Se3Pose, WORLD],
    clearance: float = 0.06,
    gap: float = 0.003,
    retreat: float = 0.12,
) -> PlacePlan:
    """Plan the placement; `target_obb` is the object's box before the grasp. Raises `PlanningError` (`unreachable`)."""

    def solve_ik(pose: Se3Pose) -> Any:
        return ctx.tool("pyroki.SolveIK", target_pose=pose)

    held = held_corners(target_obb, ee_pose_at_grasp)
    top, goal = float(support_obb.corners[:, 2].max()), support_obb.center.array[:2]
    for turn in TURNS:
        rotation = Rotation.from_euler("z", turn) * ee_pose_at_grasp.rotation.rotation
        corners = rotation.apply(held)
        xy = goal - (corners.max(axis=0) + corners.min(axis=0))[:2] / 2
        release_z = top + gap - float(corners[:, 2].min())
        carry_z = release_z + clearance
        lift_z = max(carry_z, ee_pose_at_grasp.position.z + clearance)
        lift = tcp_pose(ee_pose_at_grasp.position.array[:2], lift_z, ee_pose_at_grasp.rotation.rotation)
        carry, release = tcp_pose(xy, lift_z, rotation), tcp_pose(xy, release_z, rotation)
        rise = tcp_pose(xy, release_z + retreat, rotation)
        if all(in_reach(solve_ik, pose) for pose in (lift, carry, release, rise)):
            return PlacePlan(lift, carry, release, rise)
    raise PlanningError("unreachable", f"No pose over the support at ({goal[0]:.2f}, {goal[1]:.2f}) m is in reach.")
