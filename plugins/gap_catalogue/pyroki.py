"""Planner-free inverse kinematics and straight lines: `pyroki.*`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import (
    WORLD,
    JointState,
    Se3Pose,
    Trajectory,
    Vec3,
)


class NearestIkSolution(NamedTuple):
    """A configuration that puts the link where it was asked for."""

    joint_config: JointState
    success: bool


class TcpLine(NamedTuple):
    """A timed straight-line motion."""

    trajectory: Trajectory
    success: bool


class PyrokiSolveIK(ToolRequest[NearestIkSolution], tool="pyroki.SolveIK", effect="sense"):
    """The configuration of arm 0 nearest to `prev_config` (default: where the arm is) for a TCP pose.

    `target_link_name` (default: the hand's flange) sits at `tcp_offset` [m] from the TCP, along the TCP's axes; by
    default the robot's own TCP is meant, and no offset for another link.
    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits` with joint and excess); `success` is true
    whenever it returns.
    """

    target_pose: Annotated[Se3Pose, WORLD]
    target_link_name: str = ""
    prev_config: JointState | None = None
    tcp_offset: Vec3 | None = None


class PyrokiPlanLinear(ToolRequest[TcpLine], tool="pyroki.PlanLinear", effect="sense"):
    """A straight line of arm 0's TCP between two poses, as fast as the arm's limits allow, sampled every `dt` [s].

    It starts at the configuration for `start_pose` nearest to where the arm is; inverse kinematics is solved at
    `num_waypoints` poses at least, on one branch. Raises `BadRequestError`, or `PlanningError` (`unreachable`,
    `limits`, `no_path`, with the waypoint); `success` is true whenever it returns.
    """

    start_pose: Annotated[Se3Pose, WORLD]
    end_pose: Annotated[Se3Pose, WORLD]
    num_waypoints: int = 20
    dt: float = 0.02
