"""Proposes which models a group of touching points could be, and where each would then stand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gap_cli.contracts.types import Array
from gap_perception.scene.fit import Fit, fit, resting_size, rests
from gap_perception.scene.library import Appearance

SAMPLE = 300  # points a fit looks at
TOP_SLACK = 0.008  # m
SIDE_SLACK = 0.010  # m
SAME_SIDE = 0.006  # m: sides measured this well are taken to be seen whole


class Stance(NamedTuple):
    """How objects may stand: `whole` means their top is in sight, `tipped` that they may lie on any side, `raised` that
    they may stand on something that is no support of the cell: another object, a container's floor, a gripper."""

    whole: bool = False
    tipped: bool = False
    raised: bool = False


STANDING, UPRIGHT, LYING = Stance(whole=True), Stance(), Stance(tipped=True)
RAISED = Stance(tipped=True, raised=True)


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


def propose(library: Mapping[str, Appearance], points: Array, support: float, stance: Stance) -> list[Fit]:
    """Fits of the models whose size can explain world points (N, 3) above a surface at height `support` [m]."""
    centre, sides, yaw = rectangle(points)
    top = float(np.quantile(points[:, 2], 0.995)) - support
    chosen = points[sample(points)]
    found = []
    for name in sorted(library):
        surface = library[name]
        for rest in range(len(rests(surface.model.shape.kind)) if stance.tipped else 1):
            size = resting_size(surface, rest)
            if not stance.raised and top > size[2] + TOP_SLACK:
                continue
            if stance.whole and top < size[2] - TOP_SLACK:
                continue
            if sides.max() > np.hypot(size[0], size[1]) + SIDE_SLACK:
                continue
            starts = _starts(size, centre, sides, yaw, round_=surface.is_round and rest == 0)
            found.append(fit(surface, rest, chosen, starts, support, free=stance.raised))
    return found


def _starts(size: Array, centre: Array, sides: Array, yaw: float, *, round_: bool) -> Array:
    """Poses (S, 3) that align the model's footprint with the measured rectangle: whole, or by each of its corners."""
    starts = []
    for quarter in (0,) if round_ else (0, 1):
        along = sides if quarter == 0 else sides[::-1]
        angle = yaw + quarter * np.pi / 2
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        slack = [(size[i] - along[i]) / 2 for i in range(2)]
        shifts = [(-s, s) if s > SAME_SIDE else (0.0,) for s in slack]
        for a in shifts[0]:
            for b in shifts[1]:
                x, y = centre + a * axes[0] + b * axes[1]
                starts.append((x, y, 0.0 if round_ else angle))
    return np.array(starts)
