"""How far a hand misses the pose it is sent to: the error that scores are made for, and that measurements apply."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

from gap_runtime.contracts.types import Array, Quaternion, Se3Pose, Vec3

SPREAD = 16


@dataclass(frozen=True)
class PoseError:
    """Standard deviations of independent normal errors: of the position along each axis [m], of the rotation about
    each [deg]. Cameras, calibration and control together."""

    position: float
    rotation_deg: float

    def drawn(self, pose: Se3Pose, rng: np.random.Generator) -> Se3Pose:
        """Where the hand arrives when it is sent to `pose`."""
        turn = Rotation.from_rotvec(rng.normal(0, self.rotation_deg, 3), degrees=True)
        return Se3Pose(
            Vec3.of(pose.position.array + rng.normal(0, self.position, 3)),
            Quaternion.of(turn * pose.rotation.rotation),
        )


# Horizontally 95 % lie within 12 mm: what perception is asked for with a realistic sensor is 15 mm, control and
# calibration included. Robust grasp quality assumes the like (Weisz and Allen 2012; Mahler et al. 2016: 5 mm, 0.1 rad).
DECLARED = PoseError(0.005, 5.0)


@lru_cache(maxsize=4)
def spread(error: PoseError, count: int = SPREAD) -> tuple[Array, Array]:
    """Offsets (M, 3) [m] and rotations (M, 3, 3) of the TCP in its own frame that stand for the error: a Latin
    hypercube of its distribution (McKay, Beckman and Conover 1979), the same whenever it is asked for."""
    rng = np.random.default_rng(0)
    levels = np.stack([rng.permutation(count) for _ in range(6)], axis=1)
    normal = ndtri((levels + 0.5) / count)
    turns = Rotation.from_rotvec(normal[:, 3:] * error.rotation_deg, degrees=True)
    offsets, matrices = normal[:, :3] * error.position, turns.as_matrix()
    offsets.flags.writeable = matrices.flags.writeable = False
    return offsets, matrices
