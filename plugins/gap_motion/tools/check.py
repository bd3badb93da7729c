"""`curobo.*` served on the CPU, part three: grasp feasibility and the two trajectory validators."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_motion.arguments import joints_of, pose_list, positive, trajectory_of
from gap_motion.collision.checker import MARGIN, Checker
from gap_motion.failures import joint_range
from gap_motion.planning.feasibility import assess
from gap_motion.planning.planning_scene import Situation
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, JointState, Se3Pose, Trajectory, WorldConfig

MOST_POSES = 1000


class Feasibility(NamedTuple):
    """Aligned with the grasps asked about."""

    feasible: list[bool]
    grasp_ik_ok: list[bool]
    approach_ik_ok: list[bool]
    corridor_collision_fraction: list[float]


class Verdict(NamedTuple):
    """Whether a trajectory is free, and if not: why ("code: why"), where first (-1: nowhere), and what with what."""

    success: bool
    failure_reason: str
    first_collision_waypoint: int
    collision_status_detail: str


@tool("curobo.BatchGraspFeasibility", effect="sense", deadline_s=20.0)
def batch_grasp_feasibility(
    ctx: ToolContext,
    world_config: WorldConfig,
    start_state: JointState,
    grasp_poses: list[Annotated[Se3Pose, WORLD]],
    approach_offset_m: float = 0.10,
    ignore_obstacle_names: list[str] | None = None,
    collision_margin: float = MARGIN,
    arm_id: int = 0,
) -> Feasibility:
    """For each grasp pose of the TCP: can it be reached, from `approach_offset_m` before it, without collision.

    The gripper may touch the obstacle a grasp is in. `start_state` is where the arm comes from; nothing is planned from
    there. Raises `BadRequestError`.
    """
    poses = pose_list(grasp_poses, "grasp_poses")
    if len(poses) > MOST_POSES:
        raise BadRequestError("too_large", f"grasp_poses has {len(poses)} poses; at most {MOST_POSES} are taken.")
    situation = Situation.of(ctx, arm_id, world_config, collision_margin, ignore_obstacle_names or ())
    near = joints_of(start_state, situation.cell.spec, "start_state")
    grasped = situation.graspable(world_config, poses)
    reaching = situation.checker(reaching=True, grasped=grasped)
    offset = positive(approach_offset_m, "approach_offset_m")
    targets = situation.cell.last_frame(poses)
    found = assess(situation.cell, situation.checker(), reaching, targets, offset, near)
    return Feasibility(
        [bool(v) for v in found.feasible],
        [bool(v) for v in found.grasp],
        [bool(v) for v in found.approach],
        [round(float(v), 4) for v in found.corridor],
    )


@tool("curobo.ValidateJointTrajectoryRobot", effect="sense", deadline_s=20.0)
def validate_robot(
    ctx: ToolContext,
    world_config: WorldConfig,
    trajectory: Trajectory,
    collision_margin: float = 0.0,
    ignore_obstacle_names: list[str] | None = None,
    arm_id: int = 0,
) -> Verdict:
    """Check the points of a joint trajectory against limits, workspace, the scene, the arm itself and the other arms.

    Raises `BadRequestError`; a trajectory in collision is told in the verdict.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin, ignore_obstacle_names or ())
    start = trajectory_of(trajectory, situation.cell.spec).positions[0]
    return _verdict(situation, situation.checker_from(start), trajectory)


@tool("curobo.ValidateJointTrajectoryGrasped", effect="sense", deadline_s=20.0)
def validate_grasped(
    ctx: ToolContext,
    world_config: WorldConfig,
    trajectory: Trajectory,
    object_name: str,
    collision_margin: float = 0.0,
    ignore_obstacle_names: list[str] | None = None,
    arm_id: int = 0,
) -> Verdict:
    """As ValidateJointTrajectoryRobot, with the named obstacle held in the gripper from the first point on.

    What the object stands on it may leave, but not go deeper into. Raises `BadRequestError` (`unknown_obstacle`, ...).
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin, ignore_obstacle_names or ())
    start = trajectory_of(trajectory, situation.cell.spec).positions[0]
    held = situation.holding(world_config, object_name, start)
    return _verdict(held, held.checker_for_held(start), trajectory)


def _verdict(situation: Situation, checker: Checker, trajectory: Trajectory) -> Verdict:
    q = trajectory_of(trajectory, situation.cell.spec).positions
    low, high = joint_range(situation.cell.spec)
    beyond = ((q < low - 1e-6) | (q > high + 1e-6)).any(axis=1)
    if beyond.any():
        at = int(beyond.argmax())
        joint = situation.cell.spec.joints[int(((q[at] < low - 1e-6) | (q[at] > high + 1e-6)).argmax())]
        return Verdict(False, f"limits: {joint} is outside its range at waypoint {at}.", -1, "")
    contact = checker.first_contact(q)
    if contact is None:
        return Verdict(True, "", -1, "")
    return Verdict(False, f"in_collision: {contact} at waypoint {contact.index}.", contact.index, str(contact))


TOOLS = (batch_grasp_feasibility, validate_robot, validate_grasped)
