"""Judges a perceived box and mask by the simulator's truth. For scoring only; no tool imports this."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gap_runtime.contracts.snapshot import BodyState, WorldSnapshot
from gap_runtime.contracts.types import Array, Mask, OrientedBoundingBox

ROUND = 0.1  # relative difference of horizontal sides below which yaw means nothing
FOUND = 0.03  # m: a box centred farther off than this is not of that object


def judge(
    name: str,
    found: tuple[OrientedBoundingBox, Mask] | None,
    truth: WorldSnapshot,
    present: Sequence[str],
    visible: Sequence[Array],
) -> dict[str, Any]:
    """Whether the box is of the right object, and how far mask, centre [mm] and yaw [deg] are off.

    `visible` are the pixels (H, W) that truly show the object, camera by camera; none when it is not `present`.
    """
    row: dict[str, Any] = {"found": found is not None, "pixels": int(sum(v.sum() for v in visible)), "wrong": False}
    if found is None:
        return row
    box, mask = found
    nearest = min(present, key=lambda n: _apart(truth.bodies[n], box))
    if name not in present or nearest != name or _apart(truth.bodies[name], box) > FOUND:
        return row | {"wrong": True, "instead": nearest if _apart(truth.bodies[nearest], box) <= FOUND else "nothing"}
    body = truth.bodies[name]
    overlap = max(_iou(mask.data, v) for v in visible if v.shape == mask.data.shape)
    error = box.center.array - body.box.center.array
    return row | {"iou": overlap, "center_mm": 1e3 * float(np.linalg.norm(error)), "yaw_deg": yaw_error(body.box, box)}


def yaw_error(true: OrientedBoundingBox, box: OrientedBoundingBox) -> float | None:
    """Angle between the longer horizontal sides, 0 to 90 [deg]; None for a box (almost) square seen from above."""
    half = true.extent.array[:2]
    if abs(half[0] - half[1]) <= ROUND * half.max():
        return None
    true_axis, axis = (_long_axis(b) for b in (true, box))
    return float(np.degrees(np.arccos(np.clip(abs(true_axis @ axis), 0, 1))))


def _long_axis(box: OrientedBoundingBox) -> Array:
    axes = box.orientation.rotation.as_matrix()
    axis = axes[:2, 0] if box.extent.x >= box.extent.y else axes[:2, 1]
    return np.asarray(axis / np.linalg.norm(axis))


def _apart(body: BodyState, box: OrientedBoundingBox) -> float:
    return float(np.linalg.norm((body.box.center.array - box.center.array)[:2]))


def _iou(a: Array, b: Array) -> float:
    union = np.count_nonzero(a | b)
    return np.count_nonzero(a & b) / union if union else 0.0
