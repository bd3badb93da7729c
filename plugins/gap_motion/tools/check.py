"""`curobo.*` served on the CPU, part three: grasp feasibility and the two trajectory validators."""

from __future__ import annotations

from gap_catalogue.curobo import (
    BatchGraspFeasibility,
    GraspFeasibility,
    TrajectoryVerdict,
    ValidateJointTrajectoryGrasped,
    ValidateJointTrajectoryRobot,
)
from gap_catalogue.shared.robot_chain import joint_range
from gap_motion.arguments import joints_of, pose_list, positive, trajectory_of
from gap_motion.collision.checker import CollisionChecker
from gap_motion.planning.feasibility import assess
from gap_motion.planning.planning_scene import PlanningScene
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Trajectory

MOST_POSES = 1000


@serves(BatchGraspFeasibility)
def batch_grasp_feasibility(ctx: ToolContext, request: BatchGraspFeasibility) -> GraspFeasibility:
    poses = pose_list(request.grasp_poses, "grasp_poses", MOST_POSES)
    scene = PlanningScene.of(ctx, request)
    near = joints_of(request.start_state, scene.cell.spec, "start_state")
    grasped = scene.graspable(request.world_config, poses)
    reaching = scene.checker(reaching=True, grasped=grasped)
    offset = positive(request.approach_offset_m, "approach_offset_m")
    targets = scene.cell.last_joint_frame(poses)
    found = assess(scene.cell, scene.checker(), reaching, targets, offset, near)
    return GraspFeasibility(
        [bool(v) for v in found.feasible],
        [bool(v) for v in found.grasp],
        [bool(v) for v in found.approach],
        [round(float(v), 4) for v in found.corridor],
    )


@serves(ValidateJointTrajectoryRobot)
def validate_robot(ctx: ToolContext, request: ValidateJointTrajectoryRobot) -> TrajectoryVerdict:
    scene = PlanningScene.of(ctx, request)
    start = trajectory_of(request.trajectory, scene.cell.spec).positions[0]
    return _verdict(scene, scene.checker_from(start), request.trajectory)


@serves(ValidateJointTrajectoryGrasped)
def validate_grasped(ctx: ToolContext, request: ValidateJointTrajectoryGrasped) -> TrajectoryVerdict:
    scene = PlanningScene.of(ctx, request)
    start = trajectory_of(request.trajectory, scene.cell.spec).positions[0]
    held = scene.holding(request.world_config, request.object_name, start)
    return _verdict(held, held.checker_for_held(start), request.trajectory)


def _verdict(scene: PlanningScene, checker: CollisionChecker, trajectory: Trajectory) -> TrajectoryVerdict:
    q = trajectory_of(trajectory, scene.cell.spec).positions
    low, high = joint_range(scene.cell.spec)
    beyond = ((q < low - 1e-6) | (q > high + 1e-6)).any(axis=1)
    if beyond.any():
        at = int(beyond.argmax())
        joint = scene.cell.spec.joints[int(((q[at] < low - 1e-6) | (q[at] > high + 1e-6)).argmax())]
        return TrajectoryVerdict(False, f"limits: {joint} is outside its range at waypoint {at}.", -1, "")
    contact = checker.first_contact(q)
    if contact is None:
        return TrajectoryVerdict(True, "", -1, "")
    return TrajectoryVerdict(
        False, f"in_collision: {contact} at waypoint {contact.index}.", contact.index, str(contact)
    )


TOOLS = (batch_grasp_feasibility, validate_robot, validate_grasped)
