"""Provider `vamp`: free motions whose paths VAMP finds; goals, timing and the check afterwards stay as they are."""

from __future__ import annotations

from typing import Annotated

from gap_motion.arguments import joints_of, pose_matrix
from gap_motion.collision.checker import MARGIN
from gap_motion.planning.free_motion import to_poses
from gap_motion.planning.planning_scene import Situation
from gap_motion.tools import plan as contracts
from gap_motion.tools.plan import GraspPlan, Plan, grasp_plan, pose_plan
from gap_motion.vamp.search import VampSearch
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import WORLD, JointState, Se3Pose, Vec3, WorldConfig


@serves(contracts.plan_to_grasp_poses, provider="vamp")
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
    """A collision-free timed motion to the cheapest reachable of several grasp poses of the TCP, its path by VAMP.

    All but the path is the embedded provider's: the goals, the straight last `approach_distance` [m], the timing, and
    the check of the timed motion. Same request and seed, same motion. Raises as the embedded provider does, and
    `ToolError` (`unsupported`) for an arm that VAMP has no model of.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin, ignore_obstacle_names or ())
    search = VampSearch.of(situation)
    return grasp_plan(situation, world_config, start_joint_position, grasp_poses, approach_distance, seed, search)


@serves(contracts.plan_to_pose, provider="vamp")
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
    """A collision-free timed motion to one pose of the TCP, its path by VAMP; `improve` spends more on a shorter one.

    Raises as the embedded provider does, and `ToolError` (`unsupported`) for an arm that VAMP has no model of.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    search = VampSearch.of(situation, improve)
    return pose_plan(situation, target_pose, start_joint_position, tcp_offset, seed, search=search)


@serves(contracts.plan_with_grasped_object, provider="vamp")
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
    """A collision-free timed motion to a TCP pose with the named obstacle held, its path by VAMP.

    What is held is spheres at VAMP's tip. Raises as the embedded provider does, and `ToolError` (`unsupported`) for an
    arm that VAMP has no model of.
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    start = joints_of(start_joint_position, situation.cell.spec, "start_joint_position")
    target = situation.cell.last_frame(pose_matrix(target_pose, "target_pose"))
    held = situation.holding(world_config, object_name, start)
    return Plan(True, to_poses(held, start, target[None], seed, search=VampSearch.of(held)).trajectory)


TOOLS = (plan_to_grasp_poses, plan_to_pose, plan_with_grasped_object)
