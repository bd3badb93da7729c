"""The best grasp of both experts' union that the arm can reach, approach and lift from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import GraspError, PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.scripting import hover_height
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import (
    WORLD,
    ArmState,
    OrientedBoundingBox,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
    WorldConfig,
)

HALF_TURN = Quaternion(0.0, 0.0, 0.0, 1.0).rotation  # about the approach: the jaws exchanged
LEAN_STEP = 5.0  # degrees of leaning that count as equal
MIDDLE = 0.75  # share of a pad that holds: what only its edge meets slips out
SEEN = 12  # points of the target between the jaws from which a grasp holds what was seen
STEEP = 0.3  # least share of the approach that must point down for it to be prolonged upwards


class Choice(NamedTuple):
    """Where the straight approach begins, where the jaws close (both T_world_tcp), and the grasp's score."""

    hover_pose: Annotated[Se3Pose, WORLD]
    grasp_pose: Annotated[Se3Pose, WORLD]
    score: float


def run(
    ctx: ScriptContext,
    world: WorldConfig,
    surroundings: Annotated[PointCloud, WORLD],
    arm: ArmState,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    target_cloud: Annotated[PointCloud, WORLD],
    sampled: list[Annotated[Se3Pose, WORLD]],
    sampled_scores: list[float],
    swept: list[Annotated[Se3Pose, WORLD]],
    swept_scores: list[float],
    top_k: int = 20,
    min_score: float = 0.05,
    approach_offset: float = 0.10,
    pass_over: float = 0.03,
    lift_height: float = 0.15,
    near_best: float = 0.75,
) -> Choice:
    """Choose. Raises `GraspError` (`no_grasp`), `PlanningError` (`blocked` when none is in reach without collision)."""
    pool = [*best(sampled, sampled_scores, top_k, min_score), *best(swept, swept_scores, top_k, min_score)]
    if not pool:
        raise GraspError(
            "no_grasp",
            f"Neither expert found a grasp worth {min_score:g}: {len(sampled)} sampled, {len(swept)} swept.",
            detail={"best": max([*sampled_scores, *swept_scores], default=0.0)},
        )
    holding = [item for item in pool if between_jaws(ctx.robot(), item[0], target_cloud.points) >= SEEN]
    pool = ordered(holding or pool, near_best)
    pairs = [turned for pose, _ in pool for turned in (pose, exchanged(pose))]
    found = ctx.tool(
        "curobo.BatchGraspFeasibility",
        world_config=world,
        start_state=arm.joints,
        grasp_poses=pairs,
        approach_offset_m=approach_offset,
        ignore_obstacle_names=["target"],
    )
    over = hover_height(ctx.robot(), arm.ee_pose, target_obb, surroundings.points, pass_over)
    for i, (_, score) in enumerate(pool):
        either = [
            pose for pose, ok in zip(pairs[2 * i : 2 * i + 2], found.feasible[2 * i : 2 * i + 2], strict=True) if ok
        ]
        for pose in sorted(either, key=lambda pose: from_home(ctx, pose)):
            for hover in hovers(pose, over, approach_offset):
                if straight(ctx, hover, pose) and straight(ctx, pose, raised(pose, lift_height)):
                    return Choice(hover, pose, score)
    reached = sum(found.grasp_ik_ok)
    raise PlanningError(
        "blocked",
        f"Of {len(pairs)} grasps {reached} are in reach and {sum(found.feasible)} of them free of collision, "
        "but none can be approached and lifted straight.",
        detail={"grasps": len(pairs), "in_reach": reached, "feasible": sum(found.feasible)},
    )


def best(poses: list[Se3Pose], scores: list[float], top_k: int, least: float) -> list[tuple[Se3Pose, float]]:
    """The `top_k` best scored, none below `least`; earlier ones first among equals."""
    order = sorted(range(len(poses)), key=lambda i: -scores[i])[:top_k]
    return [(poses[i], scores[i]) for i in order if scores[i] >= least and scores[i] > 0]


def between_jaws(spec: RobotSpec, pose: Se3Pose, points: np.ndarray) -> int:
    """How many points lie between the middles of the open pads.

    Experts guess the sides no camera saw down to the support, but below a handle in the air there is nothing to hold.
    """
    _, wide, tip = spec.gripper.finger_size
    local = (points - pose.position.array) @ pose.rotation.rotation.as_matrix()
    return int((np.abs(local) <= [MIDDLE * wide, spec.gripper.max_width / 2, MIDDLE * tip]).all(axis=1).sum())


def ordered(pool: list[tuple[Se3Pose, float]], near_best: float) -> list[tuple[Se3Pose, float]]:
    """Best first; but of those nearly as good as the best the most upright: they fit best where they are put."""
    enough = near_best * max(score for _, score in pool)

    def key(item: tuple[Se3Pose, float]) -> tuple[bool, float, float]:
        pose, score = item
        lean = np.degrees(np.arccos(np.clip(-pose.rotation.rotation.as_matrix()[2, 2], -1, 1)))
        return score < enough, round(lean / LEAN_STEP) if score >= enough else 0.0, -score

    return sorted(pool, key=key)


def from_home(ctx: ScriptContext, pose: Se3Pose) -> float:
    """Largest joint motion [rad] between home and the pose, so that the wrist does not wind up; inf out of reach."""
    try:
        solved = ctx.tool("pyroki.SolveIK", target_pose=pose)
    except PlanningError:
        return np.inf
    return float(np.abs(solved.joint_config.positions - np.array(ctx.robot().home)).max())


def straight(ctx: ScriptContext, start: Se3Pose, end: Se3Pose) -> bool:
    """Can the arm take the straight line?"""
    try:
        return bool(ctx.tool("pyroki.PlanLinear", start_pose=start, end_pose=end).success)
    except PlanningError:
        return False


def hovers(pose: Se3Pose, over: float, least: float) -> Iterator[Se3Pose]:
    """Where to begin the approach: above everything in the way, else as near as it may be."""
    approach = pose.rotation.rotation.as_matrix()[:, 2]
    down = max(-float(approach[2]), STEEP)
    for length in sorted({max(least, (over - pose.position.z) / down), least}, reverse=True):
        yield Se3Pose(Vec3.of(pose.position.array - length * approach), pose.rotation)


def raised(pose: Se3Pose, height: float) -> Se3Pose:
    """The pose straight above [m]."""
    return Se3Pose(Vec3(pose.position.x, pose.position.y, pose.position.z + height), pose.rotation)


def exchanged(pose: Se3Pose) -> Se3Pose:
    """The same grasp with the jaws exchanged."""
    return Se3Pose(pose.position, Quaternion.of(pose.rotation.rotation * HALF_TURN))
