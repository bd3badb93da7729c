"""Plans how to turn a knob about the vertical: across its grip, down, round, and up again."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.scripting import in_reach, long_axis_yaw, tcp_down
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose


class TurnPlan(NamedTuple):
    """Poses T_world_tcp: over the knob, around its grip, turned, and clear of it again."""

    hover_pose: Annotated[Se3Pose, WORLD]
    grip_pose: Annotated[Se3Pose, WORLD]
    turned_pose: Annotated[Se3Pose, WORLD]
    clear_pose: Annotated[Se3Pose, WORLD]


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    state: str = "on",
    angle: float = 1.0,
    past_stop: float = 0.15,
    approach_offset: float = 0.10,
    grip_depth: float = 0.5,
) -> TurnPlan:
    """Plan the turn: counter-clockwise, seen from above, for on. Raises `BadRequestError`, `PlanningError`."""
    if state not in ("on", "off"):
        raise BadRequestError("state", f"A knob is turned on or off, not {state!r}.")

    def solve_ik(pose: Se3Pose) -> Any:
        return ctx.tool("pyroki.SolveIK", target_pose=pose)

    gripper = ctx.robot().gripper
    width = 2 * float(min(target_obb.extent.array[:2]))
    if width > gripper.max_width:
        raise PlanningError("too_wide", f"The grip is {1000 * width:.0f} mm wide; the jaws open {gripper.max_width} m.")
    turn = angle if state == "on" else -(angle + past_stop)
    xy, top = target_obb.center.array[:2], float(target_obb.corners[:, 2].max())
    height = 2 * float(target_obb.extent.z)
    grip_z = max(top - grip_depth * height, top - height + gripper.finger_size[2])
    for yaw in (long_axis_yaw(target_obb), long_axis_yaw(target_obb) + np.pi):
        ends = [tcp_down(xy, grip_z, a) for a in (yaw, yaw + turn / 2, yaw + turn)]
        over = [tcp_down(xy, grip_z + approach_offset, a) for a in (yaw, yaw + turn)]
        if all(in_reach(solve_ik, pose) for pose in (*ends, *over)):
            return TurnPlan(over[0], ends[0], ends[2], over[1])
    raise PlanningError(
        "unreachable", f"The hand cannot turn the knob at ({xy[0]:.2f}, {xy[1]:.2f}) m by {turn:.1f} rad."
    )
