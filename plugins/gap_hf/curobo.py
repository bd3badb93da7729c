"""Free motions whose paths cuRobo finds on a GPU; goals, timing and the check afterwards stay the embedded ones."""

from __future__ import annotations

from typing import Annotated

from gap_hf.curobo_search import search
from gap_hf.loading import DEADLINE_S
from gap_motion.collision.checker import MARGIN
from gap_motion.planning.planning_scene import Situation
from gap_motion.tools import plan as contracts
from gap_motion.tools.plan import GraspPlan, Plan, grasp_plan, pose_plan
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import WORLD, JointState, Se3Pose, Vec3, WorldConfig


@serves(contracts.plan_to_grasp_poses, provider="hf", deadline_s=DEADLINE_S)
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
    """A collision-free timed motion to the cheapest reachable of several grasp poses of the TCP, its path by cuRobo.

    All but the path is the embedded provider's. The first call in a process builds and warms cuRobo up. Raises as the
    embedded provider does, and `ToolError` (`extra`, `setting`, `unsupported`, `too_large`, `package`).
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin, ignore_obstacle_names or ())
    return grasp_plan(situation, world_config, start_joint_position, grasp_poses, approach_distance, seed, search)


@serves(contracts.plan_to_pose, provider="hf", deadline_s=DEADLINE_S)
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
    """A collision-free timed motion to one pose of the TCP, its path by cuRobo, which always optimises it.

    Raises as the embedded provider does, and `ToolError` (`extra`, `setting`, `unsupported`, `too_large`, `package`).
    """
    situation = Situation.of(ctx, arm_id, world_config, collision_margin)
    return pose_plan(situation, target_pose, start_joint_position, tcp_offset, seed, search=search)


TOOLS = (plan_to_grasp_poses, plan_to_pose)
