"""Where a constrained line ends: which Cartesian axes may change, how far, and how the TCP turns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array

AXES = {"x": 0, "y": 1, "z": 2}
ENDPOINTS = ("project_to_target", "fixed_distance", "orient_in_place")
ORIENTATIONS = ("hold", "target")


def directed_end(
    start: Array, target: Array, axes: Sequence[str], endpoint: str, orientation: str, distance: float
) -> Array:
    """The end pose (4, 4) of a line from `start` that moves along the allowed world axes alone.

    `project_to_target`: as far towards the target as those axes lead; `fixed_distance`: `distance` [m] that way;
    `orient_in_place`: turn only. Orientation is held or ends as the target's. Raises `BadRequestError` (`choice`,
    `range`, `empty`).
    """
    unknown = [a for a in axes if a not in AXES]
    for word, known in ((endpoint, ENDPOINTS), (orientation, ORIENTATIONS), *((a, tuple(AXES)) for a in unknown)):
        if word not in known:
            raise BadRequestError("choice", f"{word!r} is not one of {', '.join(known)}.")
    end = start.copy()
    if endpoint == "orient_in_place" or orientation == "target":
        end[:3, :3] = target[:3, :3]
    if endpoint == "orient_in_place":
        return end
    if not axes:
        raise BadRequestError("empty", "allowed_axes is empty; a line needs at least one of x, y, z.")
    free = np.isin(np.arange(3), [AXES[a] for a in axes])
    way = np.where(free, target[:3, 3] - start[:3, 3], 0.0)
    if endpoint == "fixed_distance":
        length = float(np.linalg.norm(way))
        if distance <= 0 or length < 1e-9:
            raise BadRequestError(
                "range", "fixed_distance needs a positive distance and a target that gives a direction."
            )
        way *= distance / length
    end[:3, 3] = start[:3, 3] + way
    return end


def held_end(start: Array, end: Array, weights: Sequence[float] | None) -> Array:
    """The end pose with the axes of positive weight held as at the start, in the end pose's own frame.

    `weights` are six numbers (rotation x y z, translation x y z), as cuRobo orders them. Raises `BadRequestError`.
    """
    if weights is None:
        return end
    if len(weights) != 6 or not np.isfinite(weights).all():
        raise BadRequestError("range", f"hold_vec_weight needs six finite numbers, got {list(weights)}.")
    hold = np.asarray(weights) > 0
    local = np.linalg.inv(end) @ start
    turn = Rotation.from_matrix(local[:3, :3]).as_rotvec()
    back = np.eye(4)
    back[:3, :3] = Rotation.from_rotvec(np.where(hold[:3], turn, 0.0)).as_matrix()
    back[:3, 3] = np.where(hold[3:], local[:3, 3], 0.0)
    return np.asarray(end @ back)
