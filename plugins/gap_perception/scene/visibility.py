"""Asks the cameras whether they agree that a model stands where it was fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gap_perception.scene.fit import Fit
from gap_perception.scene.points import project
from gap_runtime.contracts.types import Array, CameraObservation

SAMPLES = 300
FACING = 0.2  # cosine below which a surface is seen too flatly to evaluate_match
AGREE = 0.008  # m
BLUR_PER_PIXEL = 0.003  # m: about what a pixel sees at a metre


@dataclass(frozen=True)
class DepthView:
    """A camera with, for every pixel, the nearest depth in a small neighbourhood, 0 where unknown.

    Depths within `agree` [m] of each other are the same.
    """

    camera: CameraObservation
    nearest: Array
    agree: float = AGREE


class Agreement(NamedTuple):
    """Surface points the cameras confirm, see through, and cannot evaluate_match (hidden or out of the picture)."""

    seen: int
    through: int
    hidden: int

    @property
    def share(self) -> float:
        """Confirmed among judged; 0 when nothing could be judged."""
        judged = self.seen + self.through
        return self.seen / judged if judged else 0.0

    @property
    def visible(self) -> float:
        """Share of the surface facing a camera that is not hidden."""
        total = self.seen + self.through + self.hidden
        return (self.seen + self.through) / total if total else 0.0


def depth_view(camera: CameraObservation, blur: float = 0.0) -> DepthView:
    """Prepare a camera for `agreement`; `blur` [m] is how unsure its depths are."""
    import cv2

    depth = np.nan_to_num(camera.depth.data, nan=0.0, posinf=0.0, neginf=0.0)
    # A pixel without depth says nothing: it must not look near.
    far = np.where(depth > 0, depth, np.float32(1e3))
    side = 3 + 2 * round(blur / BLUR_PER_PIXEL)
    nearest = cv2.erode(far, np.ones((side, side), np.uint8))
    return DepthView(camera, np.where(depth > 0, nearest, np.float32(0)), AGREE + blur)


def agreement(fit: Fit, views: Sequence[DepthView]) -> Agreement:
    """Compare the fitted surface with what each camera measured there."""
    surface = fit.surface
    step = max(1, len(surface.points) // SAMPLES)
    points = surface.points[::step] @ fit.rotation.T + fit.position
    normals = surface.normals[::step] @ fit.rotation.T
    seen = through = hidden = 0
    for view in views:
        ray = view.camera.pose.position.array - points
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        facing = (normals * ray).sum(axis=1) > FACING
        columns, rows, depth = project(points[facing], view.camera)
        height, width = view.nearest.shape
        inside = (depth > 0) & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        measured = view.nearest[rows[inside], columns[inside]]
        gap = measured - depth[inside]
        known = measured > 0
        seen += int((known & (np.abs(gap) <= view.agree)).sum())
        through += int((known & (gap > view.agree)).sum())
        hidden += int((known & (gap < -view.agree)).sum()) + int((~known).sum()) + int((~inside).sum())
    return Agreement(seen, through, hidden)
