"""Batched inverse kinematics on pytorch-kinematics, for any arm; the slow way, kept as another provider and yardstick.

The chain is handed over as URDF: the library's own MJCF reader does not know the joint types of MuJoCo 3.17.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.shared.robot_chain import Chain, joint_range
from gap_motion.kinematics.damped_least_squares import halton_seeds
from gap_motion.kinematics.ik import cost
from gap_runtime.contracts.types import Array

RETRIES, ITERATIONS = 10, 40


def solve_batch(chain: Chain, T: Array, near: Array) -> Array:
    """For each pose (M, 4, 4) of the frame behind the last joint the converged solution nearest to `near` (n,).

    Returns (M, n), NaN where none converged inside the limits.
    """
    import pytorch_kinematics as pk
    import torch

    low, high = joint_range(chain.spec)
    seeds = np.concatenate([near[None], halton_seeds(low, high, RETRIES - 1)])
    solver = pk.PseudoInverseIK(
        _serial(chain), retry_configs=torch.tensor(seeds, dtype=torch.float64), max_iterations=ITERATIONS, lr=0.5,
        joint_limits=torch.tensor(np.stack([low, high], axis=1)), early_stopping_any_converged=True,
    )  # fmt: skip
    goal = pk.Transform3d(pos=torch.tensor(T[:, :3, 3]), rot=torch.tensor(T[:, :3, :3]), dtype=torch.float64)
    found = solver.solve(goal)
    q = found.solutions.detach().numpy()
    inside = (q >= low).all(axis=-1) & (q <= high).all(axis=-1)
    q = np.where((found.converged.numpy() & inside)[..., None], q, np.nan)
    best = cost(chain, q, near).argmin(axis=1)
    return np.asarray(q[np.arange(len(q)), best])


@lru_cache(maxsize=8)
def _serial(chain: Chain) -> Any:
    import pytorch_kinematics as pk
    import torch

    serial = pk.build_serial_chain_from_urdf(urdf(chain), f"frame_{chain.dof}")
    return serial.to(dtype=torch.float64)


def urdf(chain: Chain) -> str:
    """The arm's joints as URDF; link `frame_i` is the frame behind joint i, counted from 1."""
    rows = ["<robot name='arm'><link name='frame_0'/>"]
    low, high = joint_range(chain.spec)
    for i, T in enumerate(chain.before):
        x, y, z = T[:3, 3]
        roll, pitch, yaw = Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
        rows.append(
            f"<link name='frame_{i + 1}'/><joint name='joint_{i + 1}' type='revolute'><parent link='frame_{i}'/>"
            f"<child link='frame_{i + 1}'/><origin xyz='{x:.17g} {y:.17g} {z:.17g}' "
            f"rpy='{roll:.17g} {pitch:.17g} {yaw:.17g}'/><axis xyz='0 0 1'/>"
            f"<limit lower='{low[i]}' upper='{high[i]}' effort='1' velocity='1'/></joint>"
        )
    return "".join([*rows, "</robot>"])
