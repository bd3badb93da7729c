"""Proposes which models a group of touching points could be, and where each would then stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gap_perception.scene.colours import hue_histogram, overlap
from gap_perception.scene.fit import SUNK, Fit, fit, resting_size, rests
from gap_perception.scene.library import SurfaceModel
from gap_perception.scene.observed_points import ObservedPoints
from gap_runtime.contracts.types import Array

SAMPLE = 300  # points a fit looks at
TOP_SLACK = 0.008  # m
SIDE_SLACK = 0.010  # m
NO_HUES = 0.1  # overlap of hues below which a group is not of that model, whatever its shape
SAME_SIDE = 0.006  # m: sides measured this well are taken to be seen whole


class PoseHypothesis(NamedTuple):
    """How objects may stand: `whole` means their top is in sight, `tipped` that they may lie on any side, `raised` that
    they may stand on something that is no support of the cell: another object, a container's floor, a gripper."""

    whole: bool = False
    tipped: bool = False
    raised: bool = False


STANDING, UPRIGHT, LYING = PoseHypothesis(whole=True), PoseHypothesis(), PoseHypothesis(tipped=True)
RAISED = PoseHypothesis(tipped=True, raised=True)


def sample(points: Array, count: int = SAMPLE) -> Array:
    """Indices of at most `count` of the points, spread evenly and always the same."""
    if len(points) <= count:
        return np.arange(len(points))
    return np.sort(np.random.default_rng(0).permutation(len(points))[:count])


def rectangle(points: Array) -> tuple[Array, Array, float]:
    """Smallest rectangle around points seen from above: centre (2,), full sides (2,) [m], yaw of the first side."""
    import cv2

    middle = points[:, :2].mean(axis=0)
    (x, y), sides, degrees = cv2.minAreaRect((points[:, :2] - middle).astype(np.float32))
    return middle + np.array([x, y]), np.array(sides, dtype=float), float(np.radians(degrees))


def aligned(points: Array) -> tuple[Array, Array, float]:
    """As `rectangle`, along the direction in which the points spread most: the smallest rectangle around a disc with a
    handle has the handle lean to one of its corners."""
    middle = points[:, :2].mean(axis=0)
    flat = points[:, :2] - middle
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    axes = np.array([along, [-along[1], along[0]]])
    local = flat @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    return middle + (low + high) / 2 @ axes, high - low, float(np.arctan2(along[1], along[0]))


def propose(library: Mapping[str, SurfaceModel], part: ObservedPoints, hypothesis: PoseHypothesis) -> list[Fit]:
    """Fits of the models whose size and hues can explain a group of points; none that sinks into the support."""
    points, support, hues = part.points, float(np.median(part.support)), hue_histogram(part.colours)
    (centre, sides, yaw), spread = rectangle(points), aligned(points)
    top = float(np.quantile(points[:, 2], 0.995)) - support
    chosen = points[sample(points)]
    found = []
    for name in sorted(library):
        surface = library[name]
        if overlap(hues, surface.hues) < NO_HUES:
            continue
        for rest in range(len(rests(surface.model.shape.kind)) if hypothesis.tipped else 1):
            size = resting_size(surface, rest)
            if not hypothesis.raised and top > size[2] + TOP_SLACK:
                continue
            if hypothesis.whole and top < size[2] - TOP_SLACK:
                continue
            if sides.max() > np.hypot(size[0], size[1]) + SIDE_SLACK:
                continue
            starts = _starts(size, centre, sides, yaw, quarters=_quarters(surface, rest))
            if surface.model.shape.handle:
                starts = np.concatenate([starts, _starts(size, *spread, quarters=4)])
            placed = fit(surface, rest, chosen, starts, support, free=hypothesis.raised)
            if placed.position[2] - size[2] / 2 > support - SUNK:
                found.append(placed)
    return found


def _quarters(surface: SurfaceModel, rest: int) -> int:
    """How many quarter turns about the vertical show different outlines; a handle is on one side only."""
    if surface.is_round and rest == 0:
        return 1
    return 4 if surface.model.shape.handle else 2


def _starts(size: Array, centre: Array, sides: Array, yaw: float, *, quarters: int) -> Array:
    """Poses (S, 3) that align the model's footprint with the measured rectangle: whole, or by each of its corners."""
    starts = []
    for quarter in range(quarters):
        along = sides if quarter % 2 == 0 else sides[::-1]
        angle = yaw + quarter * np.pi / 2
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        slack = [(size[i] - along[i]) / 2 for i in range(2)]
        shifts = [(-s, s) if s > SAME_SIDE else (0.0,) for s in slack]
        for a in shifts[0]:
            for b in shifts[1]:
                x, y = centre + a * axes[0] + b * axes[1]
                starts.append((x, y, 0.0 if quarters == 1 else angle))
    return np.array(starts)
