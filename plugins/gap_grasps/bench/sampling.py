"""Grasps of every quality to try a score on: what the sampler offers, and blind ones beside them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from gap_grasps.bench.execution import Ranked, SeenObject
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.types import PointCloud, Quaternion, Se3Pose, Vec3

BLIND = 150  # grasps at random points of the object
LEAN_DEG = 25.0  # standard deviation of a blind grasp's lean
NEAREST = 8  # grasps near a drawn score that are tried for reach


def pool_of(cell: StandaloneContext, seen: SeenObject) -> Ranked:
    """All that `graspgen.PlanFromPointCloud` samples and as many blind grasps, scored by `graspgen.ScoreGrasps`.

    Blind ones that would meet the object or its support score 0 and are left out.
    """
    cloud = PointCloud(seen.target)
    found = cell.tool("graspgen.PlanFromPointCloud", target_cloud=cloud, scene_cloud=PointCloud(seen.scene),
                      topk_num_grasps=BLIND)  # fmt: skip
    blind = blind_grasps(cell, seen)
    scores = cell.tool("graspgen.ScoreGrasps", target_cloud=cloud, candidate_poses=blind).scores
    ranked = [*zip(found.grasp_poses, found.scores, strict=True), *zip(blind, scores, strict=True)]
    return [(pose, score) for pose, score in ranked if score > 0]


def blind_grasps(cell: StandaloneContext, seen: SeenObject) -> list[Se3Pose]:
    """The hand over random points of the object, from above or leaning, at any yaw, as deep as the palm allows."""
    rng = np.random.default_rng([cell.seed, 2])
    depth = cell.robot().gripper.finger_depth
    at = seen.target[rng.integers(len(seen.target), size=BLIND)]
    lean = Rotation.from_rotvec(np.column_stack([rng.normal(0, LEAN_DEG, (BLIND, 2)), np.zeros(BLIND)]), degrees=True)
    yaw = Rotation.from_euler("z", rng.uniform(-180, 180, (BLIND, 1)), degrees=True)
    turns = lean * yaw * Rotation.from_euler("x", 180, degrees=True)
    deep = rng.uniform(0, depth, BLIND)[:, None] * turns.as_matrix()[:, :, 2]
    return [Se3Pose(Vec3.of(p), Quaternion.of(turns[i])) for i, p in enumerate(at + deep)]


def drawn_evenly(
    ranked: Ranked, count: int, rng: np.random.Generator, reach: Callable[[Se3Pose], Se3Pose | None]
) -> Ranked:
    """Up to `count` different grasps in reach, the scores wanted spread evenly between the least and the best."""
    if not ranked:
        return []
    ranked = [ranked[i] for i in rng.permutation(len(ranked))]
    scores = np.array([score for _, score in ranked])
    drawn: Ranked = []
    for wanted in rng.uniform(scores.min(), scores.max(), count):
        for i in np.argsort(np.abs(scores - wanted), kind="stable")[:NEAREST]:
            reachable = reach(ranked[i][0])
            if reachable is not None:
                drawn.append((reachable, float(scores[i])))
                scores[i] = np.inf  # no grasp twice
                break
    return drawn
