"""Typed failures of motion, each with the numbers behind it."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array


def unreachable(what: str, distance: float, reach: float) -> PlanningError:
    """No configuration reaches a pose; `distance` is from the arm's shoulder, `reach` what its links add up to [m]."""
    return PlanningError(
        "unreachable",
        f"{what} cannot be reached: it is {distance:.3f} m from the shoulder, and the wrist reaches {reach:.3f} m.",
        hint="Choose a pose nearer to the arm, or another orientation.",
        detail={"distance_m": round(distance, 4), "reach_m": round(reach, 4)},
    )


def outside_limits(spec: RobotSpec, q: Array, what: str) -> PlanningError:
    """The joint of `q` that is farthest outside its range, and by how much."""
    low, high = joint_range(spec)
    excess = np.maximum(low - q, q - high)
    worst = int(np.argmax(excess))
    return PlanningError(
        "limits",
        f"{what} needs {spec.joints[worst]} at {q[worst]:.3f} rad, {excess[worst]:.3f} rad outside "
        f"[{low[worst]:.3f}, {high[worst]:.3f}].",
        hint="Choose another pose or another rotation about the approach axis.",
        detail={"joint": spec.joints[worst], "excess_rad": round(float(excess[worst]), 5)},
    )


def joint_range(spec: RobotSpec) -> tuple[Array, Array]:
    """Lower and upper joint limits [rad], each shape (n,)."""
    return np.array([x.lower for x in spec.limits]), np.array([x.upper for x in spec.limits])
