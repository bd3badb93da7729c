"""One action of a learned policy: a small move of the TCP, and open or closed jaws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.contracts.failures import BadRequestError
from gap_cli.contracts.types import Array, Trajectory
from gap_motion.moves import straight
from gap_motion.requests import Cell

TRANSLATION, ROTATION = 0.05, 0.5  # m, rad that an entry of 1 stands for, as robosuite's OSC_POSE controller scales it
ENTRIES = 7


def checked_action(action: Sequence[float]) -> Array:
    """The action (7,). Raises `BadRequestError`: `shape`, `not_finite`, `range` for entries outside [-1, 1]."""
    values = np.asarray(action, dtype=float)
    if values.shape != (ENTRIES,):
        raise BadRequestError(
            "shape", f"An action has {ENTRIES} numbers (dx dy dz, rx ry rz, grip), got {len(values)}."
        )
    if not np.isfinite(values).all():
        raise BadRequestError("not_finite", f"The action holds a number that is not finite: {values.tolist()}.")
    if np.abs(values).max() > 1.0 + 1e-6:
        raise BadRequestError(
            "range", f"The action holds {values[np.abs(values).argmax()]:.3f}; entries must be within [-1, 1]."
        )
    return values


def step_motion(cell: Cell, start: Array, action: Array) -> Trajectory:
    """The TCP's move from the joints `start` (n,): translation and rotation vector in the arm's base frame."""
    T = cell.chain.tcp_poses(start)[0]
    goal = T.copy()
    goal[:3, 3] += TRANSLATION * action[:3]
    goal[:3, :3] = Rotation.from_rotvec(ROTATION * action[3:6]).as_matrix() @ T[:3, :3]
    return straight(cell, start, goal @ np.linalg.inv(cell.chain.tcp))


def wants_closed(action: Array) -> bool | None:
    """True to close, False to open, None to leave the jaws: robosuite's sign, -1 open, 1 closed."""
    return None if action[6] == 0 else bool(action[6] > 0)
