"""Grasps as published networks give them: in the gripper frame that they share, with a score and a contact each.

In their frame as in ours z approaches; their x closes, our y does.
"""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.types import Array, Se3Pose, Vec3

R_GRIPPER_TCP = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # our y closes, theirs is x
PANDA_DEPTH = 0.1034  # m from the hand to the line between the fingertips: `gripper_depth` in build_6d_grasp of both


def tcp(depth: float) -> Array:
    """T_gripper_tcp of a gripper whose base lies `depth` [m] behind its fingertips."""
    T = np.eye(4)
    T[:3, :3] = R_GRIPPER_TCP
    T[2, 3] = depth
    return T


def rigid_grasps(who: str, poses: object, scores: object) -> tuple[Array, Array]:
    """Poses (K, 4, 4) and scores (K,) clipped to [0, 1]. Raises `ToolError` (`answer`) where they are no such thing."""
    try:
        T = np.asarray(poses, dtype=float).reshape(-1, 4, 4)
        values = np.asarray(scores, dtype=float).reshape(-1)
    except (ValueError, TypeError):
        raise ToolError("answer", f"{who}'s answer holds no grasps (K, 4, 4) with a score each.") from None
    R = T[:, :3, :3]
    rigid = np.isfinite(T).all() and np.allclose(R @ R.transpose(0, 2, 1), np.eye(3), atol=1e-3)
    if len(T) != len(values) or not rigid or not np.isfinite(values).all():
        raise ToolError("answer", f"{who} sent {len(T)} poses that are not rigid, or {len(values)} scores.")
    return T, values.clip(0, 1)


def listed(T: Array, scores: Array, contacts: Array) -> tuple[list[Se3Pose], list[float], list[Vec3]]:
    """TCP poses (K, 4, 4), scores (K,) and contact points (K, 3) as the fields of a contract's result."""
    return [Se3Pose.of(t) for t in T], [float(s) for s in scores], [Vec3.of(c) for c in contacts]
