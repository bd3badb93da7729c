"""One attempt: grasps from one generator, the first that is in reach executed in physics, judged by the truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from gap_catalogue.shared.hand import STRAY
from gap_runtime.contracts.failures import SimulationDivergedError, ToolError
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.types import (
    Array,
    CameraObservation,
    JointState,
    Mask,
    PointCloud,
    Quaternion,
    Se3Pose,
    Vec3,
)

APPROACH = 0.10  # m of straight approach
OVER = 0.30  # m of height from which nothing on the floor is in the way
SPEED = 0.25  # m/s of the approach: at 1 m/s a leaning arm overshoots by several millimetres
LIFT = 0.15  # m
HOLD = 1.0  # s
SHAKE = (0.04, -0.04)  # m to the sides, one after the other, as fast as the arm's limits allow up to 1 m/s
VOID = "void: diverged"  # a try whose physics blew up says nothing
OUT_OF_REACH = tuple(
    f"{step}: {code}" for step in ("approach", "lift") for code in ("unreachable", "no_path", "limits")
)
OFF_STOPS = 0.02  # rad: where a joint is this near to its stop, the arm refuses motions that overshoot a little
ONE_BRANCH = 1.0  # rad a joint may turn while lifting; more means another branch of the inverse kinematics
TRIED = 24  # grasps asked for reach before the generator is given up
HALF_TURN = Quaternion(0.0, 0.0, 0.0, 1.0).rotation  # about z: the jaws exchanged


@dataclass(frozen=True)
class SeenObject:
    """What the generators get: the target's cloud, everything seen, the wrist camera's frame and its mask."""

    target: Array
    scene: Array
    wrist: CameraObservation
    mask: Mask


Ranked = list[tuple[Se3Pose, float]]
Generator = Callable[[StandaloneContext, SeenObject], Ranked]


def by_graspgen(cell: StandaloneContext, seen: SeenObject) -> Ranked:
    """`graspgen.PlanFromPointCloud` on the target's cloud, clear of the rest."""
    found = cell.tool(
        "graspgen.PlanFromPointCloud", target_cloud=PointCloud(seen.target), scene_cloud=PointCloud(seen.scene)
    )
    return list(zip(found.grasp_poses, found.scores, strict=True))


def by_m2t2(cell: StandaloneContext, seen: SeenObject) -> Ranked:
    """`m2t2.PlanFromPointCloud` on the scene's cloud, with the target's."""
    found = cell.tool(
        "m2t2.PlanFromPointCloud", scene_cloud=PointCloud(seen.scene), target_cloud=PointCloud(seen.target)
    )
    return list(zip(found.grasp_poses, found.scores, strict=True))


def by_graspnet(cell: StandaloneContext, seen: SeenObject) -> Ranked:
    """`graspnet.PlanFromDepth` on the wrist camera's frame alone."""
    camera = seen.wrist
    found = cell.tool(
        "graspnet.PlanFromDepth", depth=camera.depth, intrinsics=camera.intrinsics, segmentation=seen.mask
    )
    T = camera.pose.matrix
    ranked = zip(found.grasp_poses[:TRIED], found.scores[:TRIED], strict=True)
    return [(Se3Pose.of(T @ pose.matrix), score) for pose, score in ranked]


def by_box(cell: StandaloneContext, seen: SeenObject) -> Ranked:
    """`geometry_svc.TopDownGraspCandidates` of the cloud's box, as deep as palm and fingertips allow."""
    gripper = cell.robot().gripper
    obb = cell.tool("geometry_svc.FilterAndComputeOBB", point_cloud=PointCloud(seen.target))
    top, bottom = obb.center.z + obb.extent.z, seen.target[:, 2].min()
    z = max(obb.center.z, top - gripper.finger_depth + 0.006, bottom + gripper.finger_size[2])
    found = cell.tool("geometry_svc.TopDownGraspCandidates", obb=obb, z_offset=float(z - obb.center.z))
    return [(pose, 1.0 - 0.5 * i) for i, pose in enumerate(found.poses)]


GENERATORS: dict[str, Generator] = {
    "graspgen": by_graspgen,
    "m2t2": by_m2t2,
    "graspnet": by_graspnet,
    "box": by_box,
}


def attempt(cell: StandaloneContext, seen: SeenObject, generate: Generator) -> dict[str, Any]:
    """Plan, take the best grasp that is in reach, execute it. `reason` is empty where every motion was carried out."""
    row: dict[str, Any] = {"grasps": 0, "rank": None, "score": None, "ms": None, "reason": ""}
    started = time.process_time()
    try:
        ranked = generate(cell, seen)
    except ToolError as error:
        return row | {"reason": error.code}
    row |= {"grasps": len(ranked), "ms": 1e3 * (time.process_time() - started)}
    for rank, (pose, score) in enumerate(ranked[:TRIED]):
        reachable = in_reach(cell, pose, seen.scene)
        if reachable is not None:
            return row | {"rank": rank, "score": score, "pose": reachable, "reason": execute(cell, reachable)}
    return row | {"reason": "unreachable" if ranked else "no_grasp"}


def in_reach(cell: StandaloneContext, pose: Se3Pose, scene: Array) -> Se3Pose | None:
    """The grasp, or the one with the jaws exchanged, if the arm can approach, take and lift so, clear of the scene."""
    for turned in (pose, Se3Pose(pose.position, Quaternion.of(pose.rotation.rotation * HALF_TURN))):
        try:
            down = cell.tool("pyroki.PlanLinear", start_pose=high_up(turned), end_pose=backed_off(turned)).trajectory
            way = cell.tool("pyroki.PlanLinear", start_pose=backed_off(turned), end_pose=turned).trajectory
            cell.tool("pyroki.PlanLinear", start_pose=turned, end_pose=lifted(turned))
            taken = JointState(way.positions[-1])
            up = cell.tool("pyroki.SolveIK", target_pose=lifted(turned), prev_config=taken).joint_config
        except ToolError:
            continue
        on_one_branch = np.abs(up.positions - taken.positions).max() < ONE_BRANCH
        moves = np.concatenate([down.positions, way.positions, up.positions[None]])
        if (
            on_one_branch
            and _within_limits(cell, moves)
            and all(_arm_is_clear(cell, way.positions[i], scene) for i in (0, len(way.positions) // 2, -1))
        ):
            return turned
    return None


def _within_limits(cell: StandaloneContext, positions: Array) -> bool:
    """Do the joints (N, dof) stay off their stops?"""
    low, high = np.array([(j.lower, j.upper) for j in cell.robot().limits]).T
    return bool(((positions >= low + OFF_STOPS) & (positions <= high - OFF_STOPS)).all())


def _arm_is_clear(cell: StandaloneContext, joints: Array, scene: Array) -> bool:
    """Does the arm, up to and without the hand, meet at most a stray point?"""
    from gap_catalogue.shared.robot_chain import chain, sphere_centers

    spec, base = cell.robot(), cell.cell.arms[0].base_pose
    before = [k.frame < spec.dof - 1 for k in (chain(spec).links[s.link] for s in spec.spheres)]
    centers = sphere_centers(spec, joints)[before] @ base.rotation.rotation.as_matrix().T + base.position.array
    radii = np.array([s.radius for s in spec.spheres])[before]
    distance, nearest = cKDTree(centers).query(scene, distance_upper_bound=float(radii.max()))
    met = np.isfinite(distance)
    return int(np.count_nonzero(distance[met] < radii[nearest[met]])) <= STRAY


def execute(cell: StandaloneContext, pose: Se3Pose) -> str:
    """Approach, close, lift, hold and shake. '' or what ended it early: its step and the error's code, or `VOID`."""
    up = lifted(pose)
    aside = [Se3Pose(Vec3.of(up.position.array + np.array([0.0, y, 0.0])), up.rotation) for y in SHAKE]
    steps: list[tuple[str, Callable[[], Any]]] = [
        ("way", lambda: cell.tool("gripper.Open")),
        ("way", lambda: cell.tool("robot_control.GoToPose", pose=high_up(pose))),
        ("way", lambda: cell.tool("robot_control.GoToPoseCartesian", pose=backed_off(pose))),
        ("approach", lambda: cell.tool("robot_control.GoToPoseCartesian", pose=pose, lin_vel_norm=SPEED)),
        ("close", lambda: cell.tool("gripper.Close")),
        ("lift", lambda: cell.tool("robot_control.GoToPoseCartesian", pose=up)),
        ("hold", lambda: cell.cell.wait(HOLD)),
        *(("shake", partial(cell.tool, "robot_control.GoToPoseCartesian", pose=p)) for p in (*aside, up)),
        ("hold", lambda: cell.cell.wait(HOLD / 2)),
    ]
    for step, do in steps:
        try:
            do()
        except SimulationDivergedError:
            return VOID
        except ToolError as error:
            if step != "shake":  # what cannot be shaken so far out is still held or not
                return f"{step}: {error.code}"
    return ""


def was_tried(row: Mapping[str, Any]) -> bool:
    """Did the hand get as far as the grasp? What stops an arm on its way, or physics, says nothing about the grasp."""
    reason = row["reason"]
    return row["score"] is not None and not reason.startswith("way") and reason not in (*OUT_OF_REACH, VOID)


def backed_off(pose: Se3Pose) -> Se3Pose:
    """Where the straight approach begins."""
    return Se3Pose(Vec3.of(pose.position.array - APPROACH * pose.matrix[:3, 2]), pose.rotation)


def high_up(pose: Se3Pose) -> Se3Pose:
    """Above where the straight approach begins: joints that turn freely must not sweep the object away."""
    back = backed_off(pose).position
    return Se3Pose(Vec3(back.x, back.y, max(back.z, OVER)), pose.rotation)


def lifted(pose: Se3Pose) -> Se3Pose:
    """Where the object is held up."""
    return Se3Pose(Vec3.of(pose.position.array + np.array([0.0, 0.0, LIFT])), pose.rotation)
