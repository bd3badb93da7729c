"""Closed-form inverse kinematics of 6-joint arms with three parallel axes (shoulder, elbow, first wrist), vectorised.

The classic geometric solution of the Universal Robots arms (Hawkins, "Analytic Inverse Kinematics for the Universal
Robots UR-5/UR-10 Arms", 2013): waist, wrist, then the planar two-link arm between them, in up to eight branches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_runtime.contracts.types import Array

BRANCHES = 8
STRAIGHT = 1e-7  # sine of the fifth joint below which the last joint is free


@dataclass(frozen=True, eq=False)
class UrGeometry:
    """Link lengths [m], as Denavit-Hartenberg parameters, and the base's fixed transform before the first joint."""

    base: Array
    d1: float
    a2: float
    a3: float
    d4: float
    d5: float


def geometry(chain: Chain) -> UrGeometry | None:
    """The lengths of an arm of this kind, or None when it is of another."""
    if chain.dof != 6:
        return None
    T = chain.before
    expected = np.zeros((6, 3))
    d1, a2, a3, d4, d5 = (float(v) for v in (T[1, 2, 3], T[2, 0, 3], T[3, 0, 3], T[4, 2, 3], T[5, 2, 3]))
    expected[1, 2], expected[2, 0], expected[3, 0], expected[4, 2], expected[5, 2] = d1, a2, a3, d4, d5
    turns = np.array([[[1, 0, 0], [0, 1 - abs(k), -k], [0, k, 1 - abs(k)]] for k in (1, 0, 0, 1, -1)])
    same = np.allclose(T[1:, :3, 3], expected[1:], atol=1e-9) and np.allclose(T[1:, :3, :3], turns, atol=1e-6)
    return UrGeometry(T[0], d1, a2, a3, d4, d5) if same else None


def solve(g: UrGeometry, T: Array, last: Array) -> Array:
    """All configurations that put the frame behind joint 6 at `T` (N, 4, 4) in the base frame.

    `last` (N,) [rad] is the last joint's value where a straight wrist leaves it free. Returns (N, 8, 6) [rad], NaN
    where a branch has no solution. Joint limits are not considered.
    """
    T = np.linalg.inv(g.base) @ T
    p, x6, y6, z6 = T[:, :3, 3], T[:, :3, 0], T[:, :3, 1], T[:, :3, 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        swing = np.arccos(g.d4 / np.hypot(p[:, 0], p[:, 1]))
        front = np.arctan2(p[:, 1], p[:, 0]) + np.pi / 2
        q1 = np.stack([front + swing, front - swing], axis=-1)  # (N, 2)
        c1, s1 = np.cos(q1), np.sin(q1)
        axis = np.stack([s1, -c1, np.zeros_like(c1)], axis=-1)  # of the three parallel joints
        bend = np.arccos(np.clip(_dot(axis, z6[:, None]), -1.0, 1.0))
        q5 = np.stack([bend, -bend], axis=-1)  # (N, 2, 2)
        s5 = np.sin(q5)
        along_x, along_y = (_dot(axis, a[:, None])[..., None] / s5 for a in (x6, y6))
        q6 = np.where(np.abs(s5) < STRAIGHT, last[:, None, None], np.arctan2(-along_y, along_x))
        z5 = -np.sin(q6)[..., None] * x6[:, None, None] - np.cos(q6)[..., None] * y6[:, None, None]
        wrist = p[:, None, None] - g.d5 * z5 - g.d4 * axis[:, :, None]
        radial = np.stack([c1, s1, np.zeros_like(c1)], axis=-1)[:, :, None]
        q234 = _planar(g, _dot(wrist, radial), wrist[..., 2] - g.d1, np.arctan2(_dot(z5, radial), -z5[..., 2]))
    out = np.empty((len(T), 2, 2, 2, 6))
    out[..., 0] = q1[:, :, None, None]
    out[..., 1:4] = q234
    out[..., 4], out[..., 5] = q5[..., None], q6[..., None]
    return out.reshape(len(T), BRANCHES, 6)


def _planar(g: UrGeometry, x: Array, y: Array, total: Array) -> Array:
    """Joints 2 to 4 of the planar arm that reaches (x, y) with the sum of its angles `total`; two elbows."""
    fold = np.arccos((x**2 + y**2 - g.a2**2 - g.a3**2) / (2 * g.a2 * g.a3))
    q3 = np.stack([fold, -fold], axis=-1)
    q2 = np.arctan2(y, x)[..., None] - np.arctan2(g.a3 * np.sin(q3), g.a2 + g.a3 * np.cos(q3))
    return np.stack([q2, q3, total[..., None] - q2 - q3], axis=-1)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))
