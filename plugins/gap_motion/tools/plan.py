"""`curobo.*` served on the CPU, part one: free motions to poses and grasps, and inverse kinematics."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from gap_motion.arguments import ArmModel, finite, joints_of, pose_list, pose_matrix
from gap_motion.collision.checker import MARGIN
from gap_motion.kinematics.ik import nearest
from gap_motion.planning.free_motion import to_grasps, to_poses
from gap_motion.planning.planner import Search
from gap_motion.planning.planning_scene import Situation
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, JointState, Se3Pose, Trajectory, Vec3, WorldConfig

MOST_POSES = 1000


class GraspPlan(NamedTuple):
    """A timed motion, and which of the grasps it leads to."""

    success: bool
    trajectory: Trajectory
    goalset_index: int


class Plan(NamedTuple):
    """A timed motion."""

    success: bool
    trajectory: Trajectory


class Solution(NamedTuple):
    """A configuration for a TCP pose."""

    success: bool
    joint_config: JointState


@tool("curobo.PlanToGraspPoses", effect="sense", deadline_s=20.0)
def plan_to_grasp_poses(
    ctx: ToolContext,
    world_config: WorldConfig,
    start_joint_position: JointState,
    grasp_poses: list[Annotated[Se3Pose, WORLD]],
    approach_distance: float = 0.08,
    collision_margin: float = MARGIN,
    ignore_obstacle_names: list[str] | None = None,
    seed: int = 0,
    arm_id: int = 0,
) -> GraspPlan:
    """A collision-free timed motion to the cheapest reachable of several grasp poses of the TCP.

    The last `approach_distance` [m] run straight along the TCP's approach axis; there the gripper may touch the
    obstacle that it grasps, which until then is avoided like the rest. Same request and seed, same motion.
    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits`, `in_collision` with the pair, `no_path`);
    `success` is true whenever it returns.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin, ignore_obstacle_names or ())
    return grasp_plan(situation, world_config, start_joint_position, grasp_poses, approach_distance, seed)


def grasp_plan(
    situation: Situation,
    world_config: WorldConfig,
    start_joint_position: JointState,
    grasp_poses: list[Se3Pose],
    approach_distance: float,
    seed: int,
    search: Search | None = None,
) -> GraspPlan:
    """`curobo.PlanToGraspPoses` in a situation; `search` stands in for the planner."""
    poses = pose_list(grasp_poses, "grasp_poses")
    if len(poses) > MOST_POSES:
        raise BadRequestError("too_large", f"grasp_poses has {len(poses)} poses; at most {MOST_POSES} are taken.")
    if finite(approach_distance, "approach_distance") < 0:
        raise BadRequestError("range", f"approach_distance must not be negative, got {approach_distance}.")
    start = joints_of(start_joint_position, situation.cell.spec, "start_joint_position")
    grasped = situation.graspable(world_config, poses)
    targets = situation.cell.last_frame(poses)
    found = to_grasps(situation, start, targets, approach_distance, grasped, seed, search)
    return GraspPlan(True, found.trajectory, found.pose)


@tool("curobo.PlanToPose", effect="sense", deadline_s=20.0)
def plan_to_pose(
    ctx: ToolContext,
    target_pose: Annotated[Se3Pose, WORLD],
    start_joint_position: JointState,
    world_config: WorldConfig | None = None,
    tcp_offset: Vec3 | None = None,
    collision_margin: float = MARGIN,
    seed: int = 0,
    improve: bool = False,
    arm_id: int = 0,
) -> Plan:
    """A collision-free timed motion to one pose of the TCP; `improve` spends more time on a shorter one.

    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits`, `in_collision` with the pair, `no_path`);
    `success` is true whenever it returns.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    return pose_plan(situation, target_pose, start_joint_position, tcp_offset, seed, improve)


def pose_plan(
    situation: Situation,
    target_pose: Se3Pose,
    start_joint_position: JointState,
    tcp_offset: Vec3 | None,
    seed: int,
    improve: bool = False,
    search: Search | None = None,
) -> Plan:
    """`curobo.PlanToPose` in a situation; `search` stands in for the planner."""
    start = joints_of(start_joint_position, situation.cell.spec, "start_joint_position")
    target = situation.cell.last_frame(pose_matrix(target_pose, "target_pose"), tcp_offset)
    return Plan(True, to_poses(situation, start, target[None], seed, improve, search).trajectory)


@tool("curobo.PlanWithGraspedObject", effect="sense", deadline_s=20.0)
def plan_with_grasped_object(
    ctx: ToolContext,
    world_config: WorldConfig,
    start_joint_position: JointState,
    target_pose: Annotated[Se3Pose, WORLD],
    object_name: str,
    collision_margin: float = MARGIN,
    seed: int = 0,
    arm_id: int = 0,
) -> Plan:
    """A collision-free timed motion to a TCP pose with the named obstacle held in the gripper as it is at the start.

    What the object stands on it may leave, but not go deeper into. Raises `BadRequestError` (`unknown_obstacle`, ...),
    or `PlanningError` (`unreachable`, `limits`, `in_collision` with the pair, `no_path`); `success` is true whenever
    it returns.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    start = joints_of(start_joint_position, situation.cell.spec, "start_joint_position")
    target = situation.cell.last_frame(pose_matrix(target_pose, "target_pose"))
    held = situation.holding(world_config, object_name, start)
    return Plan(True, to_poses(held, start, target[None], seed).trajectory)


@tool("curobo.SolveIK", effect="sense")
def solve_ik(
    ctx: ToolContext,
    target_pose: Annotated[Se3Pose, WORLD],
    seed_config: JointState | None = None,
    tcp_offset: Vec3 | None = None,
    num_seeds: int = 32,
    arm_id: int = 0,
) -> Solution:
    """The configuration nearest to `seed_config` (default: where the arm is) for a TCP pose, whatever is around it.

    `num_seeds` is for solvers that search; where the arm has a closed form, all its branches are looked at.
    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits`); `success` is true whenever it returns.
    """
    if num_seeds < 1:
        raise BadRequestError("range", f"num_seeds must be at least 1, got {num_seeds}.")
    cell = ArmModel.of(ctx, arm_id)
    target = cell.last_frame(pose_matrix(target_pose, "target_pose"), tcp_offset)
    seed = cell.joints() if seed_config is None else joints_of(seed_config, cell.spec, "seed_config")
    return Solution(True, JointState(nearest(cell.chain, target, np.asarray(seed), "target_pose")))


TOOLS = (plan_to_grasp_poses, plan_to_pose, plan_with_grasped_object, solve_ik)
