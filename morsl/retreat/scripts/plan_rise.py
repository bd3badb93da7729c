"""Plans how the hand gets clear of an object before the arm turns home: straight up, or not at all."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3


class Rise(NamedTuple):
    """T_world_tcp straight above the hand, and whether to go there."""

    rise_pose: Annotated[Se3Pose, WORLD]
    mode: Literal["rise", "stay"]


def run(
    ctx: ScriptContext,
    pose: Annotated[Se3Pose, WORLD],
    target_obb: Annotated[OrientedBoundingBox, WORLD] | None = None,
    clearance: float = 0.05,
) -> Rise:
    """Rise until the fingertips are `clearance` [m] above the target. `pose` is T_world_tcp now."""
    at = pose.position
    tips = ctx.robot().gripper.finger_size[2]
    high = at.z if target_obb is None else float(target_obb.corners[:, 2].max()) + tips + clearance
    return Rise(Se3Pose(Vec3(at.x, at.y, max(at.z, high)), pose.rotation), "rise" if high > at.z else "stay")
