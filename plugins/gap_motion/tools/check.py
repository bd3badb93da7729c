"""`curobo.*` served on the CPU, part three: grasp feasibility and the two trajectory validators."""

from __future__ import annotations

from gap_catalogue.curobo import (
    BatchGraspFeasibility,
    GraspFeasibility,
    TrajectoryVerdict,
    ValidateJointTrajectoryGrasped,
    ValidateJointTrajectoryRobot,
)
from gap_motion.arguments import joints_of, pose_list, positive, trajectory_of
from gap_motion.collision.checker import Checker
from gap_motion.failures import joint_range
from gap_motion.planning.feasibility import assess
from gap_motion.planning.planning_scene import Situation
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Trajectory

MOST_POSES = 1000


@serves(BatchGraspFeasibility)
def batch_grasp_feasibility(ctx: ToolContext, request: BatchGraspFeasibility) -> GraspFeasibility:
    poses = pose_list(request.grasp_poses, "grasp_poses", MOST_POSES)
    situation = Situation.of(ctx, request)
    near = joints_of(request.start_state, situation.cell.spec, "start_state")
    grasped = situation.graspable(request.world_config, poses)
    reaching = situation.checker(reaching=True, grasped=grasped)
    offset = positive(request.approach_offset_m, "approach_offset_m")
    targets = situation.cell.last_frame(poses)
    found = assess(situation.cell, situation.checker(), reaching, targets, offset, near)
    return GraspFeasibility(
        [bool(v) for v in found.feasible],
        [bool(v) for v in found.grasp],
        [bool(v) for v in found.approach],
        [round(float(v), 4) for v in found.corridor],
    )


@serves(ValidateJointTrajectoryRobot)
def validate_robot(ctx: ToolContext, request: ValidateJointTrajectoryRobot) -> TrajectoryVerdict:
    situation = Situation.of(ctx, request)
    start = trajectory_of(request.trajectory, situation.cell.spec).positions[0]
    return _verdict(situation, situation.checker_from(start), request.trajectory)


@serves(ValidateJointTrajectoryGrasped)
def validate_grasped(ctx: ToolContext, request: ValidateJointTrajectoryGrasped) -> TrajectoryVerdict:
    situation = Situation.of(ctx, request)
    start = trajectory_of(request.trajectory, situation.cell.spec).positions[0]
    held = situation.holding(request.world_config, request.object_name, start)
    return _verdict(held, held.checker_for_held(start), request.trajectory)


def _verdict(situation: Situation, checker: Checker, trajectory: Trajectory) -> TrajectoryVerdict:
    q = trajectory_of(trajectory, situation.cell.spec).positions
    low, high = joint_range(situation.cell.spec)
    beyond = ((q < low - 1e-6) | (q > high + 1e-6)).any(axis=1)
    if beyond.any():
        at = int(beyond.argmax())
        joint = situation.cell.spec.joints[int(((q[at] < low - 1e-6) | (q[at] > high + 1e-6)).argmax())]
        return TrajectoryVerdict(False, f"limits: {joint} is outside its range at waypoint {at}.", -1, "")
    contact = checker.first_contact(q)
    if contact is None:
        return TrajectoryVerdict(True, "", -1, "")
    return TrajectoryVerdict(
        False, f"in_collision: {contact} at waypoint {contact.index}.", contact.index, str(contact)
    )


TOOLS = (batch_grasp_feasibility, validate_robot, validate_grasped)
