"""`curobo.*` served on the CPU, part one: free motions to poses and grasps, and inverse kinematics.

The three planning functions are what other providers of the names share: all but the search of the path.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gap_catalogue.curobo import (
    CuroboSolveIK,
    GraspMotionPlan,
    IkSolution,
    MotionPlan,
    PlanToGraspPoses,
    PlanToPose,
    PlanWithGraspedObject,
)
from gap_motion.arguments import ArmModel, finite, joints_of, pose_list, pose_matrix
from gap_motion.kinematics.ik import nearest
from gap_motion.planning.free_motion import to_grasps, to_poses
from gap_motion.planning.planner import PathSearch
from gap_motion.planning.planning_scene import PlanningScene
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import JointState

MOST_POSES = 1000
PathSearchOf = Callable[[PlanningScene], PathSearch | None]  # what finds paths in a planning scene; None: OMPL


def by_ompl(scene: PlanningScene) -> None:
    """The embedded search."""


@serves(PlanToGraspPoses)
def plan_to_grasp_poses(ctx: ToolContext, request: PlanToGraspPoses) -> GraspMotionPlan:
    return grasp_plan(ctx, request)


def grasp_plan(ctx: ToolContext, request: PlanToGraspPoses, search_of: PathSearchOf = by_ompl) -> GraspMotionPlan:
    """`curobo.PlanToGraspPoses` by any search."""
    scene = PlanningScene.of(ctx, request)
    poses = pose_list(request.grasp_poses, "grasp_poses", MOST_POSES)
    if finite(request.approach_distance, "approach_distance") < 0:
        raise BadRequestError("range", f"approach_distance must not be negative, got {request.approach_distance}.")
    start = joints_of(request.start_joint_position, scene.cell.spec, "start_joint_position")
    grasped = scene.graspable(request.world_config, poses)
    targets = scene.cell.last_joint_frame(poses)
    search = search_of(scene)
    found = to_grasps(scene, start, targets, request.approach_distance, grasped, request.seed, search)
    return GraspMotionPlan(True, found.trajectory, found.pose)


@serves(PlanToPose)
def plan_to_pose(ctx: ToolContext, request: PlanToPose) -> MotionPlan:
    return pose_plan(ctx, request)


def pose_plan(ctx: ToolContext, request: PlanToPose, search_of: PathSearchOf = by_ompl) -> MotionPlan:
    """`curobo.PlanToPose` by any search."""
    scene = PlanningScene.of(ctx, request)
    start = joints_of(request.start_joint_position, scene.cell.spec, "start_joint_position")
    target = scene.cell.last_joint_frame(pose_matrix(request.target_pose, "target_pose"), request.tcp_offset)
    search = search_of(scene)
    return MotionPlan(True, to_poses(scene, start, target[None], request.seed, request.improve, search).trajectory)


@serves(PlanWithGraspedObject)
def plan_with_grasped_object(ctx: ToolContext, request: PlanWithGraspedObject) -> MotionPlan:
    return held_plan(ctx, request)


def held_plan(ctx: ToolContext, request: PlanWithGraspedObject, search_of: PathSearchOf = by_ompl) -> MotionPlan:
    """`curobo.PlanWithGraspedObject` by any search."""
    scene = PlanningScene.of(ctx, request)
    start = joints_of(request.start_joint_position, scene.cell.spec, "start_joint_position")
    target = scene.cell.last_joint_frame(pose_matrix(request.target_pose, "target_pose"))
    held = scene.holding(request.world_config, request.object_name, start)
    return MotionPlan(True, to_poses(held, start, target[None], request.seed, search=search_of(held)).trajectory)


@serves(CuroboSolveIK)
def solve_ik(ctx: ToolContext, request: CuroboSolveIK) -> IkSolution:
    """Where the arm has a closed form, all its branches are looked at."""
    if request.num_seeds < 1:
        raise BadRequestError("range", f"num_seeds must be at least 1, got {request.num_seeds}.")
    cell = ArmModel.of(ctx, request.arm_id)
    target = cell.last_joint_frame(pose_matrix(request.target_pose, "target_pose"), request.tcp_offset)
    seed = cell.joints() if request.seed_config is None else joints_of(request.seed_config, cell.spec, "seed_config")
    return IkSolution(True, JointState(nearest(cell.chain, target, np.asarray(seed), "target_pose")))


TOOLS = (plan_to_grasp_poses, plan_to_pose, plan_with_grasped_object, solve_ik)
