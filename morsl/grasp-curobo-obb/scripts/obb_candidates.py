"""Top-down grasps of a box that fit the jaws, for a planner to choose from: on and off its middle, leaning or not."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import GraspError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3

STEP = 0.01  # m between grasps along the object
TILT_STEP = 15.0  # degrees between leans
EDGE = 0.004  # m between a pad and the object's edge
ELONGATED = 1.2  # side ratio below which a footprint may be round, and a pad off its middle would squeeze it out
HALF_TURN = Rotation.from_euler("z", np.pi)


class Candidates(NamedTuple):
    """Grasps T_world_tcp and, for each, the object's width across the jaws [m]."""

    poses: list[Annotated[Se3Pose, WORLD]]
    widths: list[float]


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD],
    grasp_depth: float = 0.5,
    max_shift: float = 0.03,
    max_tilt_deg: float = 30.0,
    jaw_margin: float = 0.003,
    support_clearance: float = 0.006,
    palm_clearance: float = 0.006,
) -> Candidates:
    """Every grasp worth offering. Raises `GraspError` (`too_wide`) when no side fits the jaws."""
    spec = ctx.robot()
    limit = spec.gripper.max_width - 2 * jaw_margin
    made = ctx.tool("geometry_svc.TopDownGraspCandidates", obb=target_obb)
    widths = [target_obb.extent_along(pose.rotation.rotation.apply([0.0, 1.0, 0.0])) for pose in made.poses]
    if min(widths) > limit:
        raise GraspError(
            "too_wide",
            f"The object is {1000 * min(widths):.0f} mm wide at its narrowest; the jaws take {1000 * limit:.0f} mm.",
            detail={"width": min(widths), "limit": limit},
        )
    found = Candidates([], [])
    for middle, width in zip(made.poses, widths, strict=True):
        if width > limit:
            continue
        for shift in shifts(spec, target_obb, middle, width, max_shift):
            for lean in leans(max_tilt_deg):
                for exchange in (Rotation.identity(), HALF_TURN):
                    pose = middle.moved([shift, 0.0, 0.0]).turned(lean * exchange)
                    z = height(spec, target_obb, pose, grasp_depth, support_clearance, palm_clearance)
                    found.poses.append(Se3Pose(Vec3(pose.position.x, pose.position.y, z), pose.rotation))
                    found.widths.append(width)
    return found


def shifts(spec: RobotSpec, obb: OrientedBoundingBox, pose: Se3Pose, width: float, most: float) -> list[float]:
    """Distances [m] along the pads from the object's middle at which a whole pad still meets the object."""
    long = obb.extent_along(pose.rotation.rotation.apply([1.0, 0.0, 0.0]))
    limit = min(most, long / 2 - spec.gripper.finger_size[1] - EDGE) if long > ELONGATED * width else 0.0
    steps = np.arange(STEP, limit + 1e-9, STEP)
    return [0.0, *(float(sign * s) for s in steps for sign in (1, -1))]


def leans(most: float) -> list[Rotation]:
    """Turns about the closing direction, so that the jaws stay level."""
    steps = np.arange(TILT_STEP, most + 1e-9, TILT_STEP)
    return [Rotation.from_euler("y", a, degrees=True) for a in [0.0, *(sign * s for s in steps for sign in (1, -1))]]


def height(
    spec: RobotSpec, obb: OrientedBoundingBox, pose: Se3Pose, depth: float, above_support: float, under_palm: float
) -> float:
    """Height of the TCP [m]: the wished share below the top, no deeper than palm, fingertips and support allow."""
    top, bottom = obb.center.z + obb.extent.z, obb.center.z - obb.extent.z
    _, wide, tip = spec.gripper.finger_size
    down = -pose.rotation.rotation.as_matrix()[2]  # how much each axis of the TCP points down
    return float(
        max(
            top - depth * (top - bottom),
            bottom + tip * down[2] + wide * abs(down[0]) + above_support,
            top - spec.gripper.finger_depth * down[2] + under_palm,
        )
    )
