"""Corrects a camera's calibration by what it is known to see: horizontal supports at known heights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.types import Array, CameraObservation, Se3Pose

NEAR = 0.03  # m: pixels this close to a support may be the support
STRIDE = 5  # of the pixels looked at, along both sides
FEWEST = 300  # pixels from which a plane is believed
ROUNDS = 4
INLIER = 2.5  # robust standard deviations beyond which a pixel is no support
STEEPEST = 0.03  # rad: a larger tilt is no calibration error


@dataclass(frozen=True)
class ExtrinsicCorrection:
    """The supports appear `offset` [m] too high at the `middle` (2,) [m], rising by `slope` (2,) along x and y.

    `tilt` [m] is the error's root mean square over the pixels that see them.
    """

    middle: Array
    offset: float
    slope: Array
    tilt: float

    def applied(self, camera: CameraObservation) -> CameraObservation:
        """The camera moved so that it sees the supports where they are."""
        turn = Rotation.from_rotvec([-self.slope[1], self.slope[0], 0.0]).as_matrix()
        pivot = np.array([*self.middle, 0.0])
        T = camera.pose.matrix
        T[:3, 3] = turn @ (T[:3, 3] - pivot) + pivot - [0.0, 0.0, self.offset]
        T[:3, :3] = turn @ T[:3, :3]
        return replace(camera, pose=Se3Pose.of(T))


def fit_support_plane(x: Array, y: Array, height: Array, known: Array) -> ExtrinsicCorrection:
    """Fit a plane to the heights (H, W) of pixels at world x, y near a support; level where too few see one."""
    part = np.s_[::STRIDE, ::STRIDE]
    near = known[part] & (np.abs(height[part]) < NEAR)
    points = np.column_stack([x[part][near], y[part][near], height[part][near]]).astype(np.float64)
    none = ExtrinsicCorrection(np.zeros(2), 0.0, np.zeros(2), 0.0)
    if len(points) < FEWEST:
        return none
    middle = points[:, :2].mean(axis=0)
    A = np.column_stack([points[:, :2] - middle, np.ones(len(points))])
    # The first plane is level at the commonest height: objects' feet and shelves near the support must not tilt it.
    fitted = np.array([0.0, 0.0, np.median(points[:, 2])])
    for _ in range(ROUNDS):
        rest = points[:, 2] - A @ fitted
        spread = max(1.4826 * float(np.median(np.abs(rest))), 1e-5)
        inside = np.abs(rest) <= INLIER * spread
        fitted = np.linalg.lstsq(A[inside], points[inside, 2], rcond=None)[0]
    if np.abs(fitted[:2]).max() > STEEPEST:
        return none
    return ExtrinsicCorrection(middle, float(fitted[2]), fitted[:2], float(np.sqrt(np.mean((A @ fitted) ** 2))))
