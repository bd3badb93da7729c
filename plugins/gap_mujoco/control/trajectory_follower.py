"""Follows one commanded trajectory with one arm, notices when it does not, and comes to rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from gap_mujoco.control.contact_reaction import Trail, give_way
from gap_mujoco.control.setpoints import Setpoints, refused, setpoints
from gap_mujoco.control.stop_trajectory import braking
from gap_mujoco.model.compiled import TIMESTEP
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Array, Trajectory

if TYPE_CHECKING:
    from gap_mujoco.control.joint_controller import Drive

TRACKING_LIMIT = 0.1  # [rad] a joint may lag behind its set-point
LOOK_EVERY = 5  # steps between looks at tracking and outside torque
_LOOKS_IN_CONTACT = 2  # looks in a row before it counts, so that a tap does not
_REST_SPEED = 0.03  # [rad/s]
_SETTLE_TIME = 1.0  # [s] granted after the last set-point


class Motion:
    """One command. Its next set-point is always written before physics steps; `advance` is called after every step.

    `done` once the arm is at rest, at the end or, with a `failure`, where it stopped. `stopped` says whether the arm
    was told to stop since the command was given.
    """

    def __init__(
        self, drive: Drive, trajectory: Trajectory, tolerance: float, stopped: Callable[[], bool], *, flying: bool
    ) -> None:
        if not 0 < tolerance < 1:
            raise refused(f"a tolerance of {tolerance} rad is outside 0 to 1 rad")
        start = drive.applied if flying else None
        points = setpoints(trajectory, drive.spec, drive.positions, drive.target, start)
        self._drive, self.stopped = drive, stopped
        self.begun, self.done = drive.physics.time, False
        self.failure: MotionError | None = None
        self.goal: Array = points.positions[-1]  # [rad]
        self._ended, self._pressed, self._trail = False, 0, Trail(drive)
        self._course: Iterator[None] = chain(self._follow(points), self._settle(self.goal, tolerance))

    @property
    def going_on(self) -> bool:
        """True while it is on its way, and nothing has told it to come to rest."""
        return not (self.done or self._ended or self.stopped())

    def advance(self) -> None:
        """Look at what the last step did, and write the next set-point."""
        if self.done:
            return
        try:
            next(self._course)
        except StopIteration:
            self.done = True
        except MotionError as error:
            self.end(error)

    def end(self, error: MotionError | None = None) -> None:
        """Go no further: come to rest, because of a failure or (None) since another arm had one."""
        if self._ended or self.done:
            return
        self.failure, self._ended = error, True
        blocked = error is not None and error.code != "stopped"
        self._course = self._give_way() if blocked else self._brake()
        self.advance()

    def _brake(self) -> Iterator[None]:
        applied = self._drive.applied
        return self._write(braking(self._drive.spec, applied.positions, applied.velocities, applied.accelerations))

    def _give_way(self) -> Iterator[None]:
        return give_way(self._drive, self._trail)

    def _write(self, points: Setpoints) -> Iterator[None]:
        for position, velocity in zip(*points, strict=True):
            self._drive.aim(position, velocity)
            yield
        self._drive.aim(self._drive.target, np.zeros(self._drive.spec.dof))

    def _follow(self, points: Setpoints) -> Iterator[None]:
        for k, _ in enumerate(self._write(points)):
            self._go_on()
            yield
            self._look(k)

    def _settle(self, end: Array, tolerance: float) -> Iterator[None]:
        for k in range(round(_SETTLE_TIME / TIMESTEP)):
            error, speed = np.abs(self._drive.positions - end), np.abs(self._drive.velocities).max()
            if error.max() < tolerance and speed < _REST_SPEED:
                return
            self._go_on()
            yield
            self._look(k)
        raise self._failure("stalled", "rad short of the end", np.abs(self._drive.positions - end), tolerance)

    def _go_on(self) -> None:
        if self.stopped():
            raise MotionError("stopped", "The arm was told to stop.")

    def _look(self, step: int) -> None:
        """Every few steps: is the arm where it should be, and does anything push it?"""
        if step % LOOK_EVERY:
            return
        self._trail.mark()
        outside, limit = self._drive.outside_torque, self._drive.outside_limit
        self._pressed = self._pressed + 1 if (outside > limit).any() else 0
        if self._pressed >= _LOOKS_IN_CONTACT:
            raise self._failure("contact", "Nm from outside", outside, limit)
        lag = np.abs(self._drive.positions - self._drive.target)
        if lag.max() > TRACKING_LIMIT:
            raise self._failure("tracking", "rad behind its set-point", lag, TRACKING_LIMIT)

    def _failure(self, code: str, what: str, values: Array, limits: Any) -> MotionError:
        limits = np.broadcast_to(limits, values.shape)
        worst = int((values / limits).argmax())
        joint, value, limit = self._drive.spec.joints[worst], float(values[worst]), float(limits[worst])
        message = f"The arm stopped ({code}): {joint} {value:.3f} {what}, limit {limit:.3f}."
        return MotionError(code, message, detail={"joint": joint, "value": value, "limit": limit})
