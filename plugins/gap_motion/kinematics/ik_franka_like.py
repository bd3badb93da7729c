"""Closed-form inverse kinematics of 7-joint arms with an elbow offset and an offset wrist, vectorised.

The geometry is that of He and Liu, "Analytical Inverse Kinematics for Franka Emika Panda - a Geometrical Solver for
7-DOF Manipulators with Unconventional Design" (ICCMA 2021): the last joint is the free parameter, and fixes the wrist
centre; the triangle shoulder-elbow-wrist then gives the rest, in up to eight branches. Frames are Craig's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_runtime.contracts.types import Array

BRANCHES = 8
_TURN = (0, -1, 1, 1, -1, 1, 1)  # quarter turns about x between consecutive joints


@dataclass(frozen=True)
class FrankaGeometry:
    """Link lengths [m]: shoulder height, upper arm, forearm, elbow offset, wrist offset."""

    d1: float
    d3: float
    d5: float
    a4: float
    a7: float


def geometry(chain: Chain) -> FrankaGeometry | None:
    """The lengths of an arm of this kind, or None when it is of another."""
    if chain.dof != 7:
        return None
    T = chain.before
    d1, d3, d5, a4, a7 = (float(v) for v in (T[0, 2, 3], -T[2, 1, 3], T[4, 1, 3], T[3, 0, 3], T[6, 0, 3]))
    expected = np.zeros((7, 3))
    expected[0, 2], expected[2, 1], expected[3, 0] = d1, -d3, a4
    expected[4, :2], expected[6, 0] = (-a4, d5), a7
    turns = np.array([[[1, 0, 0], [0, 1 - abs(k), -k], [0, k, 1 - abs(k)]] for k in _TURN])
    same = np.allclose(T[:, :3, 3], expected, atol=1e-9) and np.allclose(T[:, :3, :3], turns, atol=1e-6)
    return FrankaGeometry(d1, d3, d5, a4, a7) if same else None


def solve(g: FrankaGeometry, T: Array, q7: Array) -> Array:
    """All configurations that put the frame behind joint 7 at `T`, with joint 7 at `q7`.

    T (N, 4, 4) in the base frame, q7 (N,) [rad]; returns (N, 8, 7) [rad] in (-pi, pi], NaN where a branch has no
    solution. Joint limits are not considered.
    """
    x7, y7, z7 = T[:, :3, 0], T[:, :3, 1], T[:, :3, 2]
    c7, s7 = np.cos(q7)[:, None], np.sin(q7)[:, None]
    x6, z6, y6 = c7 * x7 - s7 * y7, s7 * x7 + c7 * y7, -z7
    reach = np.array([0.0, 0.0, g.d1]) - (T[:, :3, 3] - g.a7 * x6)  # wrist centre to shoulder
    with np.errstate(invalid="ignore", divide="ignore"):
        q4 = _elbow(g, reach)  # (N, 2)
        c4, s4 = np.cos(q4), np.sin(q4)
        along = g.a4 * s4 - g.d3 * c4 - g.d5  # shoulder seen from the wrist, in the elbow's frame: y, then x
        across = g.a4 * (1 - c4) - g.d3 * s4
        q6 = _wrist(reach, x6, y6, along)  # (N, 2, 2): elbow, wrist
        z5 = np.sin(q6)[..., None] * x6[:, None, None] + np.cos(q6)[..., None] * y6[:, None, None]
        x4 = (reach[:, None, None] - along[..., None, None] * z5) / across[..., None, None]
        z4 = _cross(x4, z5)
        x5 = _cross(z5, np.broadcast_to(z6[:, None, None], z5.shape))
        q5 = np.arctan2(-_dot(x5, z4), _dot(x5, x4))
        x3 = c4[..., None, None] * x4 - s4[..., None, None] * z5
        z3 = s4[..., None, None] * x4 + c4[..., None, None] * z5
        q123 = _shoulder(x3, z3)  # (N, 2, 2, 2, 3): elbow, wrist, shoulder
    out = np.empty((len(T), 2, 2, 2, 7))
    out[..., :3] = q123
    out[..., 3] = q4[:, :, None, None]
    out[..., 4] = q5[..., None]
    out[..., 5] = q6[..., None]
    out[..., 6] = q7[:, None, None, None]
    return out.reshape(len(T), BRANCHES, 7)


def _elbow(g: FrankaGeometry, reach: Array) -> Array:
    """Joint 4 from the distance between shoulder and wrist: |reach|^2 = k + a cos q4 + b sin q4."""
    k = 2 * g.a4**2 + g.d3**2 + g.d5**2
    a, b = 2 * (g.d3 * g.d5 - g.a4**2), -2 * g.a4 * (g.d3 + g.d5)
    turn, swing = np.arctan2(b, a), np.arccos((_dot(reach, reach) - k) / np.hypot(a, b))
    return _wrap(np.stack([turn - swing, turn + swing], axis=-1))


def _wrist(reach: Array, x6: Array, y6: Array, along: Array) -> Array:
    """Joint 6 from the forearm's angle to the line wrist-shoulder: u_x sin q6 + u_y cos q6 = along."""
    ux, uy = _dot(reach, x6), _dot(reach, y6)
    turn, swing = np.arctan2(ux, uy)[:, None], np.arccos(along / np.hypot(ux, uy)[:, None])
    return _wrap(np.stack([turn - swing, turn + swing], axis=-1))


def _shoulder(x3: Array, z3: Array) -> Array:
    """Joints 1 to 3 from two axes of the upper arm."""
    tilt = np.arctan2(np.hypot(z3[..., 0], z3[..., 1]), z3[..., 2])
    q2 = np.stack([tilt, -tilt], axis=-1)
    azimuth = np.arctan2(z3[..., 1], z3[..., 0])
    q1 = _wrap(np.stack([azimuth, azimuth + np.pi], axis=-1))
    c1, s1, c2, s2 = np.cos(q1), np.sin(q1), np.cos(q2), np.sin(q2)
    x, y, z = (x3[..., i, None] for i in range(3))
    q3 = np.arctan2(c1 * y - s1 * x, c2 * (c1 * x + s1 * y) - s2 * z)
    return np.stack([q1, q2, q3], axis=-1)


def _cross(a: Array, b: Array) -> Array:
    """As np.cross for arrays of one shape (..., 3), without what it costs to find out which shapes it was given."""
    out = np.empty_like(a)
    for i, (k, m) in enumerate(((1, 2), (2, 0), (0, 1))):
        out[..., i] = a[..., k] * b[..., m] - a[..., m] * b[..., k]
    return out


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))


def _wrap(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
