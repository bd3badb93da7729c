"""Several arms on one clock: every physics step moves all of them, and when one fails all of them stop."""

from __future__ import annotations

from collections.abc import Sequence

from gap_cli.contracts.failures import MotionError
from gap_cli.contracts.types import Trajectory
from gap_mujoco.motion import Motion
from gap_mujoco.physics import Physics
from gap_mujoco.setpoints import refused


def execute_together(
    physics: Physics, motions: Sequence[Motion], trajectories: Sequence[Trajectory], tolerance: float
) -> None:
    """Track all trajectories to their ends. Raises `MotionError`, once every arm has come to a stop."""
    if not 0 < tolerance < 1:
        raise refused(f"a tolerance of {tolerance} rad is outside 0 to 1 rad")
    courses = [motion.course(trajectory, tolerance) for motion, trajectory in zip(motions, trajectories, strict=True)]
    running = list(courses)
    try:
        while running := [course for course in running if next(course, True) is None]:
            physics.step()
    except MotionError as error:
        _brake(physics, motions, from_measured=error.code != "stopped")
        raise


def _brake(physics: Physics, motions: Sequence[Motion], *, from_measured: bool) -> None:
    slowing = [motion.braking(from_measured=from_measured) for motion in motions]
    while slowing := [course for course in slowing if next(course, True) is None]:
        physics.step()
