"""After a contact: the arm comes to rest, stops pressing, and if it is still pushed backs off the way it came."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from gap_mujoco.control.point_to_point import joint_move
from gap_mujoco.control.setpoints import setpoints
from gap_mujoco.control.stop_trajectory import braking
from gap_mujoco.model.compiled import TIMESTEP
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Array

if TYPE_CHECKING:
    from gap_mujoco.control.joint_controller import Drive

BACK_OFF = 0.010  # [m] of the TCP, at most
RELEASED = 0.2  # of the torque that counts as a contact: with that much left the arm need not back off further
_BLOCKED_SPEED = 0.05  # [rad/s]: something else has stopped the arm
_RELAX = 25  # steps for the force to go once the arm no longer presses
_MARKS = 100  # looks that are remembered: one second


class Trail:
    """Where the arm has just been: measured joints (n,) and TCP (3,), oldest first."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._marks: deque[tuple[Array, Array]] = deque(maxlen=_MARKS)

    def mark(self) -> None:
        """Remember this instant."""
        self._marks.append((self._drive.positions.copy(), self._drive.tcp().position.array))

    def back(self, distance: float) -> Array | None:
        """The last joints (n,) at which the TCP was `distance` [m] from here, or the oldest known; None for none."""
        here = self._drive.tcp().position.array
        for joints, tcp in reversed(self._marks):
            if np.linalg.norm(tcp - here) >= distance:
                return joints
        return self._marks[0][0] if self._marks else None


def give_way(drive: Drive, trail: Trail) -> Iterator[None]:
    """Yields whenever physics is to step. At most a stop, then `BACK_OFF` at half the joints' limits."""
    for slower in braking(drive.spec, drive.positions, drive.velocities, np.zeros(drive.spec.dof)).velocities:
        if np.abs(drive.velocities).max() < _BLOCKED_SPEED:
            break
        velocity = _no_faster(slower, drive.velocities)  # so that it never pushes against what slows it down
        drive.aim(drive.positions + velocity * TIMESTEP, velocity)
        yield
    yield from _let_go(drive)
    if _pressed(drive):
        yield from _back_off(drive, trail)


def _no_faster(wanted: Array, measured: Array) -> Array:
    """The wanted velocities (n,), brought down to the measured ones in size, and to zero where those are reversed."""
    size = np.minimum(np.abs(wanted), np.maximum(np.sign(wanted) * measured, 0.0))
    return np.asarray(np.sign(wanted) * size)


def _let_go(drive: Drive) -> Iterator[None]:
    """The set-point is put where the arm is: what it was pressed with is gone."""
    for _ in range(_RELAX):
        drive.aim(drive.positions, np.zeros(drive.spec.dof))
        yield


def _back_off(drive: Drive, trail: Trail) -> Iterator[None]:
    goal = trail.back(BACK_OFF)
    if goal is None:
        return
    low, high = (np.array([getattr(x, k) for x in drive.spec.limits]) for k in ("lower", "upper"))
    start = np.clip(drive.positions, low, high)
    try:
        points = setpoints(joint_move(drive.spec, start, np.clip(goal, low, high)), drive.spec, start, drive.target)
    except MotionError:
        return  # what is too far out of its range to be led back stays where it is
    for position, velocity in zip(*points, strict=True):
        drive.aim(position, velocity)
        yield
        if not _pressed(drive):
            break
    applied = drive.applied
    for position, velocity in zip(
        *braking(drive.spec, applied.positions, applied.velocities, applied.accelerations), strict=True
    ):
        drive.aim(position, velocity)
        yield
    drive.aim(drive.target, np.zeros(drive.spec.dof))


def _pressed(drive: Drive) -> bool:
    return bool((drive.outside_torque > RELEASED * drive.outside_limit).any())
