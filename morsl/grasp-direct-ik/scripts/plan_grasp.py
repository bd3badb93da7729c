"""Chooses a top-down grasp from a box: across the side that fits, as deep as the hand may go, clear of neighbours."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.contracts.failures import GraspError, PlanningError
from gap_cli.contracts.robot import RobotSpec
from gap_cli.contracts.tool import ScriptContext
from gap_cli.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3, WorldConfig

STEP = 0.01  # m between grasps tried along the object
EDGE = 0.004  # m between a pad and the object's edge


class GraspPlan(NamedTuple):
    """Where to turn the wrist, where to close the jaws (both T_world_tcp), and the width between them there [m]."""

    hover_pose: Annotated[Se3Pose, WORLD]
    grasp_pose: Annotated[Se3Pose, WORLD]
    width: float


class Candidate(NamedTuple):
    """One grasp: its pose, the object's width across the jaws, how far off the object's middle it is, and the room
    the hand has there [m]."""

    pose: Se3Pose
    width: float
    shift: float
    room: float


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    world: WorldConfig,
    approach_offset: float = 0.10,
    pass_over: float = 0.03,
    grasp_depth: float = 0.5,
    max_shift: float = 0.03,
    jaw_margin: float = 0.003,
    support_clearance: float = 0.004,
    palm_clearance: float = 0.006,
    neighbour_clearance: float = 0.005,
    tolerated_contact: float = 0.010,
) -> GraspPlan:
    """Plan the grasp.

    Raises `GraspError` (`too_wide`), `PlanningError` (`blocked` by a neighbour, `unreachable`).
    """
    spec = ctx.robot()
    tall = 2 * target_obb.extent.z
    z = grasp_height(spec, target_obb, grasp_depth * tall, support_clearance, palm_clearance)
    made = ctx.tool("geometry_svc.TopDownGraspCandidates", obb=target_obb, z_offset=z - target_obb.center.z)
    poses = [turned for pose in made.poses for turned in (pose, half_turn(ctx, pose))]
    widths = [width_across(target_obb, pose) for pose in poses]
    limit = spec.gripper.max_width - 2 * jaw_margin
    fitting = [(pose, width) for pose, width in zip(poses, widths, strict=True) if width <= limit]
    if not fitting:
        raise GraspError(
            "too_wide",
            f"The object is {1000 * min(widths):.0f} mm wide at its narrowest; the jaws take {1000 * limit:.0f} mm.",
            detail={"width": min(widths), "limit": limit},
        )
    around = points_of(world)
    candidates = [
        Candidate(moved, width, abs(shift), room(spec, moved, around, approach_offset))
        for pose, width in fitting
        for shift in shifts(spec, target_obb, pose, max_shift)
        for moved in [shifted(pose, shift)]
    ]
    chosen = choose(ctx, spec, candidates, neighbour_clearance, tolerated_contact)
    start = ctx.tool("robot_control.GetEEPose").pose
    height = hover_height(spec, start, chosen.pose, around, approach_offset, pass_over)
    return GraspPlan(at_height(chosen.pose, height), chosen.pose, chosen.width)


def grasp_height(
    spec: RobotSpec, obb: OrientedBoundingBox, below_top: float, support_clearance: float, palm_clearance: float
) -> float:
    """Height of the TCP [m]: `below_top` under the object's top, no deeper than palm, fingertips and support allow."""
    top, bottom = obb.center.z + obb.extent.z, obb.center.z - obb.extent.z
    above_support = bottom + spec.gripper.finger_size[2] + support_clearance
    under_palm = top - spec.gripper.finger_depth + palm_clearance
    return max(top - below_top, above_support, under_palm)


def half_turn(ctx: ScriptContext, pose: Se3Pose) -> Se3Pose:
    """The same grasp with the jaws exchanged."""
    quarter = ctx.tool("geometry_svc.RotateQuatZ90", quat=pose.rotation)
    return Se3Pose(pose.position, ctx.tool("geometry_svc.RotateQuatZ90", quat=quarter))


def width_across(obb: OrientedBoundingBox, pose: Se3Pose) -> float:
    """Extent of the box along the closing direction [m]."""
    closing = pose.rotation.rotation.apply([0.0, 1.0, 0.0])
    axes = obb.orientation.rotation.as_matrix()
    return float(2 * np.abs(closing @ axes) @ obb.extent.array)


def shifts(spec: RobotSpec, obb: OrientedBoundingBox, pose: Se3Pose, most: float) -> list[float]:
    """Distances [m] from the object's middle along the jaws at which the whole pad still meets the object."""
    along = pose.rotation.rotation.apply([1.0, 0.0, 0.0])
    half = float(np.abs(along @ obb.orientation.rotation.as_matrix()) @ obb.extent.array)
    limit = min(most, half - spec.gripper.finger_size[1] - EDGE)
    steps = np.arange(STEP, limit + 1e-9, STEP)
    return [0.0, *(sign * float(s) for s in steps for sign in (1, -1))]


def shifted(pose: Se3Pose, shift: float) -> Se3Pose:
    """The pose moved by `shift` [m] along its own x axis."""
    return Se3Pose(Vec3.of(pose.position.array + shift * pose.rotation.rotation.apply([1.0, 0.0, 0.0])), pose.rotation)


def points_of(world: WorldConfig) -> np.ndarray:
    """Points (N, 3) [m] of everything seen but the target itself; supports have none."""
    clouds = [o.points for o in world.obstacles if o.points is not None and o.name != "target"]
    return np.concatenate([np.zeros((0, 3)), *clouds])


def room(spec: RobotSpec, pose: Se3Pose, points: np.ndarray, rise: float) -> float:
    """Least distance [m] between the open hand, over its last `rise` of descent, and the points; negative inside."""
    if not len(points):
        return np.inf
    local = pose.rotation.rotation.inv().apply(points - pose.position.array)
    gaps = [to_segment(local, center, rise) - radius for center, radius in hand_spheres(spec)]
    thick, wide, tip = spec.gripper.finger_size
    top, bottom = -spec.gripper.finger_depth - rise, tip
    for side in (-1, 1):
        center = np.array([0.0, side * (spec.gripper.max_width / 2 + thick), (top + bottom) / 2])
        gaps.append(to_box(local, center, np.array([wide, thick, (bottom - top) / 2])))
    return min(gaps)


def to_segment(points: np.ndarray, end: np.ndarray, length: float) -> float:
    """Least distance [m] of points (N, 3) to the segment that reaches from `end` back along -z by `length`."""
    along = np.clip(points[:, 2], end[2] - length, end[2])
    return float(np.hypot(np.hypot(points[:, 0] - end[0], points[:, 1] - end[1]), points[:, 2] - along).min())


def to_box(points: np.ndarray, center: np.ndarray, half: np.ndarray) -> float:
    """Least signed distance [m] of points (N, 3) to an axis-aligned box; negative inside."""
    outside = np.abs(points - center) - half
    return float((np.linalg.norm(np.maximum(outside, 0), axis=1) + np.minimum(outside.max(axis=1), 0)).min())


def hand_spheres(spec: RobotSpec) -> list[tuple[np.ndarray, float]]:
    """The hand's collision spheres as (centre in the TCP frame [m], radius [m])."""
    w, x, y, z = spec.tcp_offset_quaternion
    turn = Rotation.from_quat([x, y, z, w]).inv()
    return [
        (turn.apply(np.array(s.center) - np.array(spec.tcp_offset_position)), s.radius)
        for s in spec.spheres
        if s.link == spec.flange_link
    ]


def choose(
    ctx: ScriptContext, spec: RobotSpec, candidates: list[Candidate], clearance: float, tolerated: float
) -> Candidate:
    """The candidate with room enough that is narrowest, then nearest to the middle, then nearest to the arm's home.

    Where none has room enough, the roomiest; unless it overlaps a neighbour by more than is tolerated.
    """
    roomy = [c for c in candidates if c.room >= clearance]
    ranked = sorted(roomy, key=lambda c: (round(c.width, 4), c.shift)) or sorted(candidates, key=lambda c: -c.room)
    best: tuple[float, Candidate] | None = None
    for candidate in ranked:
        first = best[1] if best else candidate
        if best and (round(candidate.width, 4), candidate.shift) != (round(first.width, 4), first.shift):
            break
        travel = from_home(ctx, spec, candidate.pose)
        if travel is not None and (best is None or travel < best[0]):
            best = travel, candidate
    if best is None:
        at = candidates[0].pose.position
        raise PlanningError("unreachable", f"No top-down grasp at ({at.x:.2f}, {at.y:.2f}, {at.z:.2f}) m is in reach.")
    if best[1].room < -tolerated:
        raise PlanningError(
            "blocked",
            f"A neighbour is {-1000 * best[1].room:.0f} mm inside the hand's way down in the best orientation.",
            detail={"room": best[1].room},
        )
    return best[1]


def from_home(ctx: ScriptContext, spec: RobotSpec, pose: Se3Pose) -> float | None:
    """Largest joint motion [rad] between home and the pose; None when it is out of reach."""
    try:
        solved = ctx.tool("pyroki.SolveIK", target_pose=pose)
    except PlanningError:
        return None
    return float(np.abs(solved.joint_config.positions - np.array(spec.home)).max()) if solved.success else None


def hover_height(
    spec: RobotSpec, start: Se3Pose, grasp: Se3Pose, points: np.ndarray, offset: float, pass_over: float
) -> float:
    """TCP height [m] over the target from which everything between here and there is passed over."""
    a, b = start.position.array[:2], grasp.position.array[:2]
    way = b - a
    t = np.clip((points[:, :2] - a) @ way / max(float(way @ way), 1e-9), 0, 1)
    aside = np.linalg.norm(points[:, :2] - (a + t[:, None] * way), axis=1)
    beside = points[aside < spec.gripper.max_width / 2 + 2 * max(spec.gripper.finger_size), 2]
    least = grasp.position.z + offset
    if not len(beside):
        return least
    over = float(beside.max()) + spec.gripper.finger_size[2] + pass_over
    return max(least, min(over, start.position.z))


def at_height(pose: Se3Pose, z: float) -> Se3Pose:
    """The pose moved straight up or down to height `z` [m]."""
    return Se3Pose(Vec3(pose.position.x, pose.position.y, z), pose.rotation)
