"""Motion planning among obstacles: `curobo.*`."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, NamedTuple

from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import (
    WORLD,
    JointState,
    Se3Pose,
    Trajectory,
    Vec3,
    WorldConfig,
)

COLLISION_MARGIN = 0.005  # m kept between the robot and the scene
Z = Vec3(0.0, 0.0, 1.0)


class GraspMotionPlan(NamedTuple):
    """A timed motion, and which of the grasps it leads to."""

    success: bool
    trajectory: Trajectory
    goalset_index: int


class MotionPlan(NamedTuple):
    """A timed motion."""

    success: bool
    trajectory: Trajectory


class IkSolution(NamedTuple):
    """A configuration for a TCP pose."""

    success: bool
    joint_config: JointState


class LinePlan(NamedTuple):
    """A timed line, or why there is none ("code: why")."""

    success: bool
    trajectory: Trajectory
    failure_reason: str


class GraspPhases(NamedTuple):
    """Three timed motions, each starting where the one before ends, or why there are none ("code: why")."""

    success: bool
    approach_trajectory: Trajectory
    grasp_trajectory: Trajectory
    lift_trajectory: Trajectory
    failure_reason: str


class GraspFeasibility(NamedTuple):
    """Aligned with the grasps asked about."""

    feasible: list[bool]
    grasp_ik_ok: list[bool]
    approach_ik_ok: list[bool]
    corridor_collision_fraction: list[float]


class TrajectoryVerdict(NamedTuple):
    """Whether a trajectory is free, and if not: why ("code: why"), where first (-1: nowhere), and what with what."""

    success: bool
    failure_reason: str
    first_collision_waypoint: int
    collision_status_detail: str


class PlanToGraspPoses(ToolRequest[GraspMotionPlan], tool="curobo.PlanToGraspPoses", effect="sense", deadline_s=20.0):
    """A collision-free timed motion to the cheapest reachable of several grasp poses of the TCP.

    The last `approach_distance` [m] run straight along the TCP's approach axis; there the gripper may touch the
    obstacle that it grasps, which until then is avoided like the rest. Same request and seed, same motion.
    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits`, `in_collision` with the pair, `no_path`);
    `success` is true whenever it returns.
    """

    world_config: WorldConfig
    start_joint_position: JointState
    grasp_poses: list[Annotated[Se3Pose, WORLD]]
    approach_distance: float = 0.08
    collision_margin: float = COLLISION_MARGIN
    ignore_obstacle_names: list[str] | None = None
    seed: int = 0
    arm_id: int = 0


class PlanToPose(ToolRequest[MotionPlan], tool="curobo.PlanToPose", effect="sense", deadline_s=20.0):
    """A collision-free timed motion to one pose of the TCP; `improve` spends more time on a shorter one.

    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits`, `in_collision` with the pair, `no_path`);
    `success` is true whenever it returns.
    """

    target_pose: Annotated[Se3Pose, WORLD]
    start_joint_position: JointState
    world_config: WorldConfig | None = None
    tcp_offset: Vec3 | None = None
    collision_margin: float = COLLISION_MARGIN
    seed: int = 0
    improve: bool = False
    arm_id: int = 0


class PlanWithGraspedObject(
    ToolRequest[MotionPlan], tool="curobo.PlanWithGraspedObject", effect="sense", deadline_s=20.0
):
    """A collision-free timed motion to a TCP pose with the named obstacle held in the gripper as it is at the start.

    What the object stands on it may leave, but not go deeper into. Raises `BadRequestError` (`unknown_obstacle`, ...),
    or `PlanningError` (`unreachable`, `limits`, `in_collision` with the pair, `no_path`); `success` is true whenever
    it returns.
    """

    world_config: WorldConfig
    start_joint_position: JointState
    target_pose: Annotated[Se3Pose, WORLD]
    object_name: str
    collision_margin: float = COLLISION_MARGIN
    seed: int = 0
    arm_id: int = 0


class CuroboSolveIK(ToolRequest[IkSolution], tool="curobo.SolveIK", effect="sense"):
    """The configuration nearest to `seed_config` (default: where the arm is) for a TCP pose, whatever is around it.

    `num_seeds` is for solvers that search.
    Raises `BadRequestError`, or `PlanningError` (`unreachable`, `limits`); `success` is true whenever it returns.
    """

    target_pose: Annotated[Se3Pose, WORLD]
    seed_config: JointState | None = None
    tcp_offset: Vec3 | None = None
    num_seeds: int = 32
    arm_id: int = 0


class CuroboPlanLinear(ToolRequest[LinePlan], tool="curobo.PlanLinear", effect="sense", deadline_s=20.0):
    """A timed straight line of the TCP from where `start_joint_position` puts it, checked where there is a world.

    `hold_vec_weight` (rotation x y z, translation x y z, in the end pose's frame) keeps axes of positive weight as they
    are at the start. Raises `BadRequestError`; other failures are told in `failure_reason`.
    """

    start_pose: Annotated[Se3Pose, WORLD]
    end_pose: Annotated[Se3Pose, WORLD]
    start_joint_position: JointState
    world_config: WorldConfig | None = None
    num_waypoints: int = 20
    hold_vec_weight: list[float] | None = None
    collision_margin: float = COLLISION_MARGIN
    arm_id: int = 0


class PlanDirectedLinear(ToolRequest[LinePlan], tool="curobo.PlanDirectedLinear", effect="sense", deadline_s=20.0):
    """A timed line of the TCP along some world axes alone (`allowed_axes`, of "x", "y", "z").

    `endpoint_mode`: `project_to_target` goes as far towards the target as those axes lead, `fixed_distance` goes
    `distance` [m] that way, `orient_in_place` turns to the target's orientation and stays. `orientation_mode`: `hold`
    or `target`. Raises `BadRequestError`; other failures are told in `failure_reason`.
    """

    start_joint_position: JointState
    start_pose: Annotated[Se3Pose, WORLD]
    target_pose: Annotated[Se3Pose, WORLD]
    allowed_axes: list[str]
    endpoint_mode: str = "project_to_target"
    orientation_mode: str = "hold"
    distance: float = 0.0
    world_config: WorldConfig | None = None
    collision_margin: float = COLLISION_MARGIN
    arm_id: int = 0


class PlanGraspMotion(ToolRequest[GraspPhases], tool="curobo.PlanGraspMotion", effect="sense", deadline_s=20.0):
    """A grasp in three timed motions, so that the caller can move the gripper between them.

    Freely to `approach_distance` [m] before the grasp; straight along `approach_axis` (in the TCP's frame) to the
    grasp, where the gripper may touch `object_name` (default: the obstacle the grasp is in); straight along `lift_axis`
    (in the world) by `lift_distance` [m], carrying it. Raises `BadRequestError`; other failures are told in
    `failure_reason`.
    """

    start_joint_position: JointState
    grasp_pose: Annotated[Se3Pose, WORLD]
    approach_axis: Vec3 = field(default_factory=lambda: Z)
    approach_distance: float = 0.12
    lift_axis: Vec3 = field(default_factory=lambda: Z)
    lift_distance: float = 0.20
    world_config: WorldConfig | None = None
    object_name: str = ""
    collision_margin: float = COLLISION_MARGIN
    seed: int = 0
    arm_id: int = 0


class BatchGraspFeasibility(
    ToolRequest[GraspFeasibility], tool="curobo.BatchGraspFeasibility", effect="sense", deadline_s=20.0
):
    """For each grasp pose of the TCP: can it be reached, from `approach_offset_m` before it, without collision.

    The gripper may touch the obstacle a grasp is in. `start_state` is where the arm comes from; nothing is planned from
    there. Raises `BadRequestError`.
    """

    world_config: WorldConfig
    start_state: JointState
    grasp_poses: list[Annotated[Se3Pose, WORLD]]
    approach_offset_m: float = 0.10
    ignore_obstacle_names: list[str] | None = None
    collision_margin: float = COLLISION_MARGIN
    arm_id: int = 0


class ValidateJointTrajectoryRobot(
    ToolRequest[TrajectoryVerdict], tool="curobo.ValidateJointTrajectoryRobot", effect="sense", deadline_s=20.0
):
    """Check the points of a joint trajectory against limits, workspace, the scene, the arm itself and the other arms.

    Raises `BadRequestError`; a trajectory in collision is told in the verdict.
    """

    world_config: WorldConfig
    trajectory: Trajectory
    collision_margin: float = 0.0
    ignore_obstacle_names: list[str] | None = None
    arm_id: int = 0


class ValidateJointTrajectoryGrasped(
    ToolRequest[TrajectoryVerdict], tool="curobo.ValidateJointTrajectoryGrasped", effect="sense", deadline_s=20.0
):
    """As ValidateJointTrajectoryRobot, with the named obstacle held in the gripper from the first point on.

    What the object stands on it may leave, but not go deeper into. Raises `BadRequestError` (`unknown_obstacle`, ...).
    """

    world_config: WorldConfig
    trajectory: Trajectory
    object_name: str
    collision_margin: float = 0.0
    ignore_obstacle_names: list[str] | None = None
    arm_id: int = 0
