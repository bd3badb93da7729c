"""Plans the way of a held object into a container: how high, turned how, to which spot, and how deep."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.scripting import beside_way, held_corners, in_reach, points_around, tcp_pose
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, WorldConfig

SPOTS = 5  # places tried along each side of the container
CORNERS = ((1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0))  # in the container's axes
SAME_HEIGHT = 0.02  # m: heights of the content closer than this are equal, so that noise does not move the drop


Mode = Literal["free_space", "collision_aware"]
MODES: dict[str, Mode] = {"free_space": "free_space", "collision_aware": "collision_aware"}


class DropPlan(NamedTuple):
    """Poses T_world_tcp: straight above the grasp, over the container, where to let go, clear of the object again; and
    how to get over the container, which the graph branches on."""

    lift_pose: Annotated[Se3Pose, WORLD]
    carry_pose: Annotated[Se3Pose, WORLD]
    release_pose: Annotated[Se3Pose, WORLD]
    rise_pose: Annotated[Se3Pose, WORLD]
    mode: Mode


class Spot(NamedTuple):
    """Where the object's footprint goes: offset of its centre in the container's axes (2,) [m], and how high the
    content reaches below it [m]."""

    offset: np.ndarray
    height: float


def run(
    ctx: ScriptContext,
    container_obb: Annotated[OrientedBoundingBox, WORLD],
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    ee_pose_at_grasp: Annotated[Se3Pose, WORLD],
    world: WorldConfig,
    nth: int = 0,
    total: int = 1,
    mode: str = "free_space",
    clearance: float = 0.04,
    rim_clearance: float = 0.012,
    rim_width: float = 0.028,
    above_content: float = 0.01,
) -> DropPlan:
    """Plan the drop. Raises `PlanningError` (`does_not_fit`, `unreachable`)."""

    def solve_ik(pose: Se3Pose) -> Any:
        return ctx.tool("pyroki.SolveIK", target_pose=pose)

    spec = ctx.robot()
    held = held_corners(target_obb, ee_pose_at_grasp)
    seen = beside_hand(points_around(world), ee_pose_at_grasp, spec)
    inner = container_obb.extent.array[:2] - rim_width
    low = spec.gripper.finger_size[2]
    for turned in orientations(container_obb, target_obb, ee_pose_at_grasp, held, inner):
        corners = turned.apply(held)
        hang = float(-corners[:, 2].min())
        spot = choose_spot(container_obb, corners, inner, seen, parts(nth, total))
        drop = ctx.tool(
            "geometry_svc.ComputeDropPosition",
            container_obb=container_obb,
            clearance=clearance,
            object_z_extent=float(np.ptp(corners[:, 2]) / 2),
        )
        middle = (corners.max(axis=0) + corners.min(axis=0)) / 2
        xy = (drop.array + axes(container_obb)[:, :2] @ spot.offset - middle)[:2]
        over = highest_between(seen, ee_pose_at_grasp.position.array[:2], xy, spec, corners)
        carry_z = max(drop.z - float(middle[2]), over + clearance + max(hang, low))
        rim = float(container_obb.corners[:, 2].max()) + low + rim_clearance
        release_z = min(carry_z, max(rim, spot.height + above_content + hang))
        carry, release = tcp_pose(xy, carry_z, turned), tcp_pose(xy, release_z, turned)
        start = ee_pose_at_grasp
        lift = tcp_pose(start.position.array[:2], max(carry_z, start.position.z), start.rotation.rotation)
        if all(in_reach(solve_ik, p) for p in (lift, carry, release)):
            between = max(0.0, float(corners[:, 2].max()) + low)  # how much of the object the fingertips reach past
            rise = tcp_pose(xy, min(carry_z, release_z + between + clearance), turned)
            return DropPlan(
                lift, carry, release, rise, "collision_aware" if mode == "collision_aware" else "free_space"
            )
    at = container_obb.center
    raise PlanningError("unreachable", f"No pose over the container at ({at.x:.2f}, {at.y:.2f}) m is in reach.")


def orientations(
    container: OrientedBoundingBox, target: OrientedBoundingBox, grasp: Se3Pose, held: np.ndarray, inner: np.ndarray
) -> list[Rotation]:
    """TCP rotations in which the object fits the container, least turned first: as held, or aligned with its sides."""
    quarter = np.pi / 2
    skew = (yaw(container) - yaw(target) + quarter / 2) % quarter - quarter / 2
    angles = sorted({0.0, skew, skew + quarter, skew - quarter, skew + np.pi, np.pi}, key=lambda a: (abs(a), a))
    turned = [Rotation.from_euler("z", a) * grasp.rotation.rotation for a in angles]
    slack = [float((inner - footprint(container, r.apply(held)).max(axis=0)).min()) for r in turned]
    if max(slack) < 0:
        raise PlanningError(
            "does_not_fit",
            f"The object is {-2000 * max(slack):.0f} mm too wide for the opening of the container.",
            detail={"slack": max(slack)},
        )
    return [r for r, s in zip(turned, slack, strict=True) if s >= 0]


def parts(nth: int, total: int) -> np.ndarray:
    """Which parts of the container number `nth` of `total` objects may go to (K, 2): the middle, or by turns a corner;
    any corner where the number is not known (-1).

    Opposite corners first, so that two objects get as far apart as there is room.
    """
    if total == 1:
        return np.zeros((1, 2))
    return np.array(CORNERS if nth < 0 else [CORNERS[nth % len(CORNERS)]])


def choose_spot(
    container: OrientedBoundingBox, corners: np.ndarray, inner: np.ndarray, seen: np.ndarray, wanted: np.ndarray
) -> Spot:
    """The spot with the lowest content below the object; among equals the nearest to a `wanted` part, the first."""
    half = footprint(container, corners).max(axis=0)
    floor = float(container.corners[:, 2].min())
    local = (seen - container.center.array) @ axes(container)
    content = local[(np.abs(local[:, :2]) < inner).all(axis=1)]
    heights = content @ axes(container)[2] + container.center.z
    room = np.maximum(inner - half, 0)
    steps = [np.linspace(-s, s, SPOTS) for s in room]
    spots: list[Spot] = []
    for x in steps[0]:
        for y in steps[1]:
            offset = np.array([x, y])
            below = heights[(np.abs(content[:, :2] - offset) <= half).all(axis=1)]
            spots.append(Spot(offset, max(floor, float(below.max())) if len(below) else floor))
    lowest = min(s.height for s in spots)
    level = [s for s in spots if s.height <= lowest + SAME_HEIGHT]
    away = [np.round(np.linalg.norm(s.offset - wanted * room, axis=1), 3).tolist() for s in level]
    return level[min(range(len(level)), key=lambda i: min((gap, k) for k, gap in enumerate(away[i])))]


def highest_between(points: np.ndarray, a: np.ndarray, b: np.ndarray, spec: RobotSpec, corners: np.ndarray) -> float:
    """Height [m] of the highest point beside the straight way from a to b; minus infinity when there is none."""
    aside = float(np.linalg.norm(corners[:, :2], axis=1).max()) + spec.gripper.finger_size[0]
    near = beside_way(points, a, b) < aside
    return float(points[near, 2].max()) if near.any() else -np.inf


def footprint(container: OrientedBoundingBox, corners: np.ndarray) -> np.ndarray:
    """Distances of the corners from their middle along the container's horizontal axes, shape (8, 2) [m]."""
    local = corners @ axes(container)[:, :2]
    return np.abs(local - (local.max(axis=0) + local.min(axis=0)) / 2)


def beside_hand(points: np.ndarray, grasp: Se3Pose, spec: RobotSpec) -> np.ndarray:
    """The points without those over the palm: the hand came down there, so they are the arm's own outline."""
    aside = np.linalg.norm(points[:, :2] - grasp.position.array[:2], axis=1)
    over = points[:, 2] > grasp.position.z + spec.gripper.finger_depth
    return points[~(over & (aside < 2 * spec.gripper.max_width))]


def axes(obb: OrientedBoundingBox) -> np.ndarray:
    """The box's axes as columns, shape (3, 3)."""
    return np.asarray(obb.orientation.rotation.as_matrix())


def yaw(obb: OrientedBoundingBox) -> float:
    """Angle of the box's first axis about the vertical [rad]."""
    x = axes(obb)[:, 0]
    return float(np.arctan2(x[1], x[0]))
