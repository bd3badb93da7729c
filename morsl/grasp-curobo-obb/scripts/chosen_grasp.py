"""Looks up which of the offered grasps the planner went to."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, Se3Pose


class Chosen(NamedTuple):
    """The grasp T_world_tcp, and the object's width across the jaws there [m]."""

    grasp_pose: Annotated[Se3Pose, WORLD]
    width: float


def run(ctx: ScriptContext, poses: list[Annotated[Se3Pose, WORLD]], widths: list[float], index: int) -> Chosen:
    """The grasp at `index` of the goal set."""
    return Chosen(poses[index], widths[index])
