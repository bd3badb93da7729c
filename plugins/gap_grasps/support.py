"""What does it stand on? The height of a known support, or the plane that a camera sees around the target."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from gap_grasps.surface import thinned
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array

SUPPORT_MARGIN = 0.006  # m above a support below which scene points are the support's own
AROUND = 0.15  # m beside the target in which its support is looked for
NEARBY = 0.25  # m from the target beyond which nothing can meet the hand
COARSE = 0.005  # m between the points of obstacles
TRIALS = 100  # planes through three points that are tried
SHARE = 0.4  # of the points around that must lie on the plane
SAMPLED = 1500  # points a plane is fitted to


def support_below(ctx: ToolContext, points: Array) -> float | None:
    """Height of the highest known support under the middle of the points, or None."""
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return None
    middle, low = np.median(finite[:, :2], axis=0), float(finite[:, 2].min())
    heights = [
        s.z
        for s in ctx.task.environment.supports.values()
        if (np.abs(middle - s.center) <= s.half_size).all() and s.z <= low + 2 * SUPPORT_MARGIN
    ]
    return max(heights, default=None)


def plane_around(scene: Array, target: Array, rng: np.random.Generator) -> Array | None:
    """T_plane_camera (4, 4) of the plane the target stands on, z towards the camera, or None where none is seen.

    Random sample consensus (Fischler and Bolles 1981) over what lies beside the target, both in the camera frame.
    """
    beside = obstacle_points(crop_around(scene, target, AROUND), target, None)
    if len(beside) < 50:
        return None
    beside = beside[rng.choice(len(beside), min(SAMPLED, len(beside)), replace=False)]
    corners = beside[rng.integers(len(beside), size=(TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    on = np.abs(np.einsum("ki,ni->kn", normals, beside) - np.einsum("ki,ki->k", normals, corners[:, 0])[:, None])
    best = int(np.argmax((on < SUPPORT_MARGIN / 2).sum(axis=1)))
    inliers = beside[on[best] < SUPPORT_MARGIN / 2]
    if len(inliers) < SHARE * len(beside):
        return None
    middle = inliers.mean(axis=0)
    up = np.linalg.svd(inliers - middle, full_matrices=False)[2][2]
    up = up if up @ middle < 0 else -up
    x = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    R = np.stack([x / np.linalg.norm(x), np.cross(up, x / np.linalg.norm(x)), up])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, -R @ middle
    return T


def crop_around(scene: Array, target: Array, distance: float) -> Array:
    """Scene points (M, 3) in the box around the target, grown by `distance` [m]. What is not finite is nowhere."""
    inside = np.ones(len(scene), dtype=bool)
    for axis in range(3):
        values = scene[:, axis]
        inside &= (values >= target[:, axis].min() - distance) & (values <= target[:, axis].max() + distance)
    return scene[inside]


def obstacle_points(scene: Array, target: Array, floor: float | None) -> Array:
    """Scene points near the target that are neither its own nor the support's, one per `COARSE` cell, (M, 3)."""
    target = target[np.isfinite(target).all(axis=1)]
    scene = scene[np.isfinite(scene).all(axis=1)]
    if floor is not None:
        scene = scene[scene[:, 2] > floor + SUPPORT_MARGIN]
    if not len(scene) or not len(target):
        return scene
    scene = crop_around(scene, target, NEARBY)
    if not len(scene):
        return scene
    scene = thinned(scene, COARSE)
    distance, _ = cKDTree(thinned(target)).query(scene, distance_upper_bound=SUPPORT_MARGIN)
    return np.asarray(scene[~np.isfinite(distance)])
