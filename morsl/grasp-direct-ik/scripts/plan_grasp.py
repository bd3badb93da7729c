"""Chooses a grasp from above by a box: across the side that fits, as deep as the hand may go, clear of neighbours."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import GraspError, PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.scripting import hover_height, points_around
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3, WorldConfig

STEP = 0.0065  # m between grasps tried along the object
TILT_STEP = 7.5  # degrees between the ways down tried
ELONGATED = 1.2  # side ratio below which a footprint may be round, and a pad off its middle would squeeze it out
EDGE = 0.004  # m between a pad and the object's edge
AROUND = 0.35  # m: farther points cannot meet the hand


class GraspPlan(NamedTuple):
    """Where to turn the wrist, where to close the jaws (both T_world_tcp), and the width between them there [m]."""

    hover_pose: Annotated[Se3Pose, WORLD]
    grasp_pose: Annotated[Se3Pose, WORLD]
    width: float


class Candidate(NamedTuple):
    """One grasp: its pose, the object's width across the jaws, and the room the hand has on its way there [m]."""

    pose: Se3Pose
    width: float
    room: float


class Limits(NamedTuple):
    """The parameters that bound the search, see contract.yaml."""

    grasp_depth: float
    max_shift: float
    max_tilt_deg: float
    jaw_margin: float
    support_clearance: float
    palm_clearance: float


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    world: WorldConfig,
    approach_offset: float = 0.10,
    pass_over: float = 0.03,
    grasp_depth: float = 0.5,
    max_shift: float = 0.03,
    max_tilt_deg: float = 22.5,
    jaw_margin: float = 0.003,
    support_clearance: float = 0.004,
    palm_clearance: float = 0.006,
    neighbour_clearance: float = 0.005,
    tolerated_contact: float = 0.003,
) -> GraspPlan:
    """Plan the grasp. Raises `GraspError` (`too_wide`), `PlanningError` (`blocked` by a neighbour, `unreachable`)."""
    spec = ctx.robot()
    limits = Limits(grasp_depth, max_shift, max_tilt_deg, jaw_margin, support_clearance, palm_clearance)
    points = points_around(world)
    start = ctx.tool("robot_control.GetEEPose").pose
    over = hover_height(spec, start, target_obb, points, pass_over)
    near = points[np.linalg.norm(points[:, :2] - target_obb.center.array[:2], axis=1) < AROUND]
    measured: list[Candidate] = []
    for group in proposals(ctx, spec, target_obb, limits):
        candidates = [
            Candidate(pose, width, room(spec, pose, near, descent(pose, over, approach_offset)))
            for pose, width in group
        ]
        measured += candidates
        chosen = nearest_home(ctx, spec, [c for c in candidates if c.room >= neighbour_clearance])
        if chosen is not None:
            break
    else:
        chosen = roomiest(ctx, spec, measured, tolerated_contact)
    back = descent(chosen.pose, over, approach_offset)
    return GraspPlan(chosen.pose.moved([0.0, 0.0, -back]), chosen.pose, chosen.width)


def proposals(
    ctx: ScriptContext, spec: RobotSpec, obb: OrientedBoundingBox, limits: Limits
) -> Iterator[list[tuple[Se3Pose, float]]]:
    """Groups of equally good (pose, width): upright before tilted, narrow before wide, middle before off it."""
    made = ctx.tool("geometry_svc.TopDownGraspCandidates", obb=obb)
    widths = [obb.extent_along(jaws(pose)) for pose in made.poses]
    most = spec.gripper.max_width - 2 * limits.jaw_margin
    fitting = sorted((w, i) for i, w in enumerate(widths) if w <= most)
    if not fitting:
        raise GraspError(
            "too_wide",
            f"The object is {1000 * min(widths):.0f} mm wide at its narrowest; the jaws take {1000 * most:.0f} mm.",
            detail={"width": min(widths), "limit": most},
        )
    half_turn = Rotation.from_euler("z", np.pi)
    for tilt in np.arange(0.0, limits.max_tilt_deg + 1e-9, TILT_STEP):
        for width, index in fitting:
            middle = made.poses[index]
            for shift in shifts(spec, obb, middle, limits.max_shift):
                yield [
                    (grounded(spec, obb, middle.moved([x, 0.0, 0.0]).turned(lean * exchange), limits), width)
                    for x in sorted({shift, -shift})
                    for lean in (Rotation.from_euler("y", a, degrees=True) for a in sorted({tilt, -tilt}))
                    for exchange in (Rotation.identity(), half_turn)
                ]


def jaws(pose: Se3Pose) -> np.ndarray:
    """Direction in which the jaws close."""
    return pose.rotation.rotation.apply([0.0, 1.0, 0.0])


def pads(pose: Se3Pose) -> np.ndarray:
    """Direction along the width of the pads."""
    return pose.rotation.rotation.apply([1.0, 0.0, 0.0])


def shifts(spec: RobotSpec, obb: OrientedBoundingBox, pose: Se3Pose, most: float) -> list[float]:
    """Distances [m] from the object's middle, along the pads, at which a whole pad still meets the object."""
    long, wide = obb.extent_along(pads(pose)), obb.extent_along(jaws(pose))
    limit = min(most, long / 2 - spec.gripper.finger_size[1] - EDGE) if long > ELONGATED * wide else 0.0
    return [0.0, *(float(s) for s in np.arange(STEP, limit + 1e-9, STEP))]


def grounded(spec: RobotSpec, obb: OrientedBoundingBox, pose: Se3Pose, limits: Limits) -> Se3Pose:
    """The pose at its height: the wished depth, no deeper than palm, fingertips and support allow."""
    top, bottom = obb.center.z + obb.extent.z, obb.center.z - obb.extent.z
    _, wide, tip = spec.gripper.finger_size
    down = -pose.rotation.rotation.as_matrix()[2]  # how much each axis of the TCP points down
    fingertip = tip * down[2] + wide * abs(down[0])
    z = max(
        top - limits.grasp_depth * (top - bottom),
        bottom + fingertip + limits.support_clearance,
        top - spec.gripper.finger_depth * down[2] + limits.palm_clearance,
    )
    return Se3Pose(Vec3(pose.position.x, pose.position.y, float(z)), pose.rotation)


def room(spec: RobotSpec, pose: Se3Pose, points: np.ndarray, rise: float) -> float:
    """Least distance [m] between the open hand, over its last `rise` of approach, and the points; negative inside."""
    if not len(points):
        return np.inf
    local = pose.rotation.rotation.inv().apply(points - pose.position.array)
    gaps = [to_segment(local, center, rise) - radius for center, radius in hand_spheres(spec)]
    thick, wide, tip = spec.gripper.finger_size
    back = -spec.gripper.finger_depth - rise
    for side in (-1, 1):
        center = np.array([0.0, side * (spec.gripper.max_width / 2 + thick), (back + tip) / 2])
        gaps.append(to_box(local, center, np.array([wide, thick, (tip - back) / 2])))
    return min(gaps)


def palm_room(spec: RobotSpec, pose: Se3Pose, obb: OrientedBoundingBox) -> float:
    """Least distance [m] between the hand and the target's own top, between whose sides only the fingers go."""
    grid = np.array([[x, y, 1.0] for x in np.linspace(-1, 1, 5) for y in np.linspace(-1, 1, 5)])
    top = obb.orientation.rotation.apply(grid * obb.extent.array) + obb.center.array
    local = pose.rotation.rotation.inv().apply(top - pose.position.array)
    return min(to_segment(local, center, 0.0) - radius for center, radius in hand_spheres(spec))


def hand_spheres(spec: RobotSpec) -> list[tuple[np.ndarray, float]]:
    """The hand's collision spheres as (centre in the TCP frame [m], radius [m])."""
    w, x, y, z = spec.tcp_offset_quaternion
    turn = Rotation.from_quat([x, y, z, w]).inv()
    offset = np.array(spec.tcp_offset_position)
    return [(turn.apply(np.array(s.center) - offset), s.radius) for s in spec.spheres if s.link == spec.flange_link]


def to_segment(points: np.ndarray, end: np.ndarray, length: float) -> float:
    """Least distance [m] of points (N, 3) to the segment that reaches from `end` back along -z by `length`."""
    along = np.clip(points[:, 2], end[2] - length, end[2])
    return float(np.hypot(np.hypot(points[:, 0] - end[0], points[:, 1] - end[1]), points[:, 2] - along).min())


def to_box(points: np.ndarray, center: np.ndarray, half: np.ndarray) -> float:
    """Least signed distance [m] of points (N, 3) to an axis-aligned box; negative inside."""
    outside = np.abs(points - center) - half
    return float((np.linalg.norm(np.maximum(outside, 0), axis=1) + np.minimum(outside.max(axis=1), 0)).min())


def nearest_home(ctx: ScriptContext, spec: RobotSpec, candidates: list[Candidate]) -> Candidate | None:
    """The reachable candidate whose joints are nearest to the arm's home."""
    travels = [(from_home(ctx, spec, c.pose), i) for i, c in enumerate(candidates)]
    reachable = [(travel, i) for travel, i in travels if travel is not None]
    return candidates[min(reachable)[1]] if reachable else None


def roomiest(ctx: ScriptContext, spec: RobotSpec, candidates: list[Candidate], tolerated: float) -> Candidate:
    """The reachable candidate with most room, where none has enough. Raises `PlanningError`."""
    ranked = sorted(candidates, key=lambda c: -c.room)
    for candidate in ranked:
        if candidate.room < -tolerated:
            break
        if from_home(ctx, spec, candidate.pose) is not None:
            return candidate
    room_left = 1000 * ranked[0].room
    if room_left < -1000 * tolerated:
        raise PlanningError(
            "blocked",
            f"A neighbour is {-room_left:.0f} mm inside the hand's way down, however it is turned.",
            detail={"room": ranked[0].room},
        )
    at = ranked[0].pose.position
    raise PlanningError("unreachable", f"No grasp from above at ({at.x:.2f}, {at.y:.2f}, {at.z:.2f}) m is in reach.")


def from_home(ctx: ScriptContext, spec: RobotSpec, pose: Se3Pose) -> float | None:
    """Largest joint motion [rad] between home and the pose; None when it is out of reach."""
    try:
        solved = ctx.tool("pyroki.SolveIK", target_pose=pose)
    except PlanningError:
        return None
    return float(np.abs(solved.joint_config.positions - np.array(spec.home)).max()) if solved.success else None


def descent(grasp: Se3Pose, over: float, least: float) -> float:
    """Length [m] of the straight approach that starts at height `over`."""
    down = -grasp.rotation.rotation.apply([0.0, 0.0, 1.0])[2]
    return max(least, float((over - grasp.position.z) / down))
