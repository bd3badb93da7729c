"""What a robot sees of one thing on the floor: its pixels and its cloud, from depth alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gap_catalogue.shared.point_clouds import back_project, to_frame, valid_depth
from gap_catalogue.shared.robot_chain import sphere_centers
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import ArmState, Array, CameraObservation, Mask

ABOVE = 0.006  # m above the support from which a point is not the support's
BESIDE_ROBOT = 0.02  # m from the arm's collision spheres within which a point is the arm's
CELL = 0.002  # m per cell of a footprint
THIN = 0.05  # m: parts of a footprint narrower than that are handles


def pixels(ctx: ToolContext, camera: CameraObservation, arms: Sequence[ArmState]) -> Mask:
    """Pixels of a camera that show neither the supports, nor the robot, nor anything outside the workspace."""
    known = valid_depth(camera.depth)
    points = back_project(camera.depth, camera.intrinsics, known)
    # Most pixels show the floor: their height alone says so, without the whole transform.
    lowest = min(s.z for s in ctx.task.environment.supports.values()) + ABOVE
    up = camera.pose.matrix[2]
    high_enough = points @ up[:3] + up[3] >= lowest
    known[known] = high_enough
    points = to_frame(points[high_enough], camera.pose)
    low, high = np.array(ctx.task.environment.workspace)
    keep = ((points >= low) & (points <= high)).all(axis=1)
    for support in ctx.task.environment.supports.values():
        over = (np.abs(points[:, :2] - support.center) <= support.half_size).all(axis=1)
        keep &= ~(over & (points[:, 2] < support.z + ABOVE))
    keep[keep] = ~_on_robot(ctx, points[keep], arms[0])
    mask = np.zeros(known.shape, dtype=bool)
    mask[known] = keep
    return Mask(mask)


def cloud_of(camera: CameraObservation, mask: Mask) -> Array:
    """World points (N, 3) of the masked pixels."""
    pixels = mask.data & valid_depth(camera.depth)
    return to_frame(back_project(camera.depth, camera.intrinsics, pixels), camera.pose)


def handle_of(points: Array) -> Array:
    """Which points (N,) belong to a thin part of the footprint: what an opening by a disc `THIN` wide takes away."""
    import cv2

    cells = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / CELL).astype(int) + round(THIN / CELL)
    image = np.zeros(cells.max(axis=0) + 1 + round(THIN / CELL), dtype=np.uint8)
    image[cells[:, 0], cells[:, 1]] = 1
    image = cv2.morphologyEx(image, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7)))
    outlines, _ = cv2.findContours(image, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    image = cv2.drawContours(image, outlines, -1, 1, cv2.FILLED)
    side = round(THIN / CELL) | 1
    thick = cv2.morphologyEx(image, cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    # Opening rounds corners off: what is left of the body are crumbs beside the handle.
    count, labels, stats, _ = cv2.connectedComponentsWithStats(image * (1 - thick), connectivity=8)
    if count < 2:
        return np.zeros(len(points), dtype=bool)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(labels[cells[:, 0], cells[:, 1]] == largest)


def _on_robot(ctx: ToolContext, points: Array, arm: ArmState) -> Array:
    spec = ctx.robot()
    centers = to_frame(sphere_centers(spec, arm.joints.positions), ctx.cell.arms[0].base_pose)
    on = np.zeros(len(points), dtype=bool)
    for center, sphere in zip(centers, spec.spheres, strict=True):
        on |= np.linalg.norm(points - center, axis=1) <= sphere.radius + BESIDE_ROBOT
    return on
