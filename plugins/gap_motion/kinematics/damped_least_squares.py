"""Inverse kinematics of any arm by damped least squares, for many seeds at once."""

from __future__ import annotations

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_runtime.contracts.types import Array

POSITION, ROTATION = 1e-5, 1e-4  # m, rad: a pose counts as reached
STEP = 0.6  # rad: the longest joint step of one iteration
DAMPING = 1e-3


def damped_least_squares(
    chain: Chain, T: Array, seeds: Array, limits: tuple[Array, Array], iterations: int = 60
) -> Array:
    """Put the frame behind the last joint at `T` (B, 4, 4), each from its own seed (B, n), inside the joint limits.

    Returns (B, n) with NaN where it did not converge.
    """
    lower, upper = limits
    q = np.clip(seeds, lower, upper)
    out = np.full_like(q, np.nan)
    open_ = np.arange(len(q))
    for _ in range(iterations):
        error, jacobian = _error_and_jacobian(chain, q[open_], T[open_])
        near = (np.abs(error[:, :3]).max(axis=1) < POSITION) & (np.abs(error[:, 3:]).max(axis=1) < ROTATION)
        out[open_[near]] = q[open_[near]]
        open_, error, jacobian = open_[~near], error[~near], jacobian[~near]
        if not len(open_):
            break
        square = (
            jacobian @ jacobian.transpose(0, 2, 1)
            + DAMPING * np.eye(6) * np.minimum(1.0, np.linalg.norm(error, axis=1))[:, None, None]
        )
        step = (jacobian.transpose(0, 2, 1) @ np.linalg.solve(square, error[..., None]))[..., 0]
        step *= np.minimum(1.0, STEP / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-12))
        q[open_] = np.clip(q[open_] + step, lower, upper)
    return out


def halton_seeds(lower: Array, upper: Array, count: int) -> Array:
    """Deterministic seeds that fill the joint box, shape (count, n): a Halton sequence (Halton 1960)."""
    from scipy.stats.qmc import Halton

    sequence = Halton(len(lower), scramble=False)
    sequence.fast_forward(1)  # the first point is a corner of the box
    return np.asarray(lower + sequence.random(count) * (upper - lower))


def _error_and_jacobian(chain: Chain, q: Array, T: Array) -> tuple[Array, Array]:
    """Twist to the target (B, 6) and geometric Jacobian (B, 6, n)."""
    frames = chain.frames(q)
    axes, positions = (frames[..., :3, k].transpose(1, 0, 2) for k in (2, 3))
    jacobian = np.concatenate([np.cross(axes, positions[:, -1:] - positions), axes], axis=2).transpose(0, 2, 1)
    turn = rotation_vector(T[:, :3, :3] @ frames[-1, :, :3, :3].transpose(0, 2, 1))
    return np.concatenate([T[:, :3, 3] - positions[:, -1], turn], axis=1), jacobian


def rotation_vector(R: Array) -> Array:
    """Rotation vectors [rad] of matrices (B, 3, 3), shape (B, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())
