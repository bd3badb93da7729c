"""How much slower a motion must run so that the arm's motors can carry it: inverse dynamics from the robot's model.

Run k times slower, the torques of motion (inertia, Coriolis) shrink by k squared and those of gravity stay, so the
right k has a closed form. The load is the arm and its empty gripper; `SHARE` leaves room for what it carries.
"""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from gap_catalogue.shared.robot_chain import Chain
from gap_runtime.contracts.types import Array

SHARE = 0.9  # of each torque limit
EVERY = 2  # samples between those looked at
SLOWEST = 10.0  # times: a pose that gravity alone makes impossible is not saved by going slower


class Plant(NamedTuple):
    """The robot's dynamics without contacts or gravity compensation, and where its joints are in them.

    `local` keeps a state for each thread: to make one costs as much as a dozen inverse dynamics.
    """

    model: Any
    q: slice | Array
    v: slice | Array
    torque: Array
    local: threading.local


@lru_cache(maxsize=8)
def plant(chain: Chain) -> Plant:
    """The plant of a robot, loaded once."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(chain.spec.model_file))
    model.body_gravcomp[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    joints = [model.joint(name) for name in chain.spec.joints]
    torque = np.array([limit.torque for limit in chain.spec.limits])
    places = (_places([int(j.qposadr[0]) for j in joints]), _places([int(j.dofadr[0]) for j in joints]))
    return Plant(model, *places, torque, threading.local())


def _places(indices: list[int]) -> slice | Array:
    """Where the joints are in an array: a slice, which is quicker, where they are next to each other."""
    first, end = indices[0], indices[0] + len(indices)
    return slice(first, end) if indices == list(range(first, end)) else np.array(indices)


def torques(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """Joint torques [Nm] that motion (N, n) needs, shape (N, n)."""
    import mujoco

    made, out = plant(chain), np.empty_like(q)
    if not hasattr(made.local, "data"):
        made.local.data = mujoco.MjData(made.model)
    data = made.local.data
    qpos, qvel, qacc, force = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
    for k in range(len(q)):
        qpos[made.q], qvel[made.v], qacc[made.v] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(made.model, data)
        out[k] = force[made.v]
    return out


def torque_stretch(chain: Chain, q: Array, dq: Array, step: float) -> float:
    """The factor, at least 1, by which samples (N, n) `step` [s] apart must be slowed down."""
    ddq = np.gradient(dq, step, axis=0)[::EVERY]
    q, dq = q[::EVERY], dq[::EVERY]
    needed = torques(chain, q, dq, ddq)
    bound = SHARE * plant(chain).torque
    if (np.abs(needed) <= bound).all():
        return 1.0
    still = torques(chain, q, np.zeros_like(q), np.zeros_like(q))
    motion = needed - still
    room = np.maximum(np.where(motion > 0, bound - still, bound + still), 1e-6)
    return float(np.clip(np.sqrt((np.abs(motion) / room).max()), 1.0, SLOWEST))
