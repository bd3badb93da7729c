"""Follows set-points with one arm, notices when it does not, and brakes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any

import numpy as np

from gap_cli.contracts.failures import MotionError
from gap_cli.contracts.types import Array, GripperState, Trajectory
from gap_mujoco.compiled import TIMESTEP
from gap_mujoco.drive import Drive
from gap_mujoco.setpoints import Setpoints, refused, setpoints

TRACKING_LIMIT = 0.1  # [rad] a joint may lag behind its set-point
TORQUE_SHARE = 0.3  # of a joint's torque limit: more than that from outside is a collision
_LOOK_EVERY = 5  # steps between looks at tracking and outside torque
_LOOKS_IN_CONTACT = 2  # looks in a row before it counts, so that a tap does not
_REST_SPEED = 0.03  # [rad/s]
_SETTLE_TIME = 1.0  # [s] granted after the last set-point
_MAX_SETTLE = 10.0  # [s] of jaws


class Motion:
    """One command at a time, on the world's thread. `stopped` is asked after every step."""

    def __init__(self, drive: Drive, stopped: Callable[[], bool]) -> None:
        self._drive, self._physics, self._stopped = drive, drive.physics, stopped
        self._outside_limit = TORQUE_SHARE * np.array([j.torque for j in drive.spec.limits])
        self._acceleration = np.array([j.acceleration for j in drive.spec.limits])
        self._pressed = 0

    def execute(self, trajectory: Trajectory, tolerance: float) -> None:
        """Track a trajectory to its end. Raises `MotionError`, once the arm has come to a stop."""
        if not 0 < tolerance < 1:
            raise refused(f"a tolerance of {tolerance} rad is outside 0 to 1 rad")
        course = self.course(trajectory, tolerance)
        try:
            for _ in course:
                self._physics.step()
        except MotionError as error:
            for _ in self.braking(from_measured=error.code != "stopped"):
                self._physics.step()
            raise

    def course(self, trajectory: Trajectory, tolerance: float) -> Iterator[None]:
        """Yields whenever the physics is to step, with this arm's set-point written. Raises `MotionError`."""
        points = setpoints(trajectory, self._drive.spec, self._drive.positions, self._drive.target)
        return chain(self._follow(points), self._settle(points.positions[-1], tolerance))

    def set_gripper(self, width: float, force: float | None, settle: float) -> GripperState:
        """Drive the jaws until they arrive or are blocked, then let `settle` [s] pass. Raises `MotionError`."""
        if not 0 <= settle <= _MAX_SETTLE:
            raise refused(f"a settle time of {settle} s is outside 0 to {_MAX_SETTLE:.0f} s")
        jaws = self._drive.jaws
        jaws.aim(width, force)
        try:
            while not jaws.done():
                self._step()
            for _ in range(round(settle / TIMESTEP)):
                self._step()
        except MotionError:
            jaws.halt()
            raise
        return jaws.state()

    def _step(self) -> None:
        self._go_on()
        self._physics.step()

    def _go_on(self) -> None:
        if self._stopped():
            raise MotionError("stopped", "The arm was told to stop.")

    def _follow(self, points: Setpoints) -> Iterator[None]:
        for k, (position, velocity) in enumerate(zip(*points, strict=True)):
            self._drive.target, self._drive.velocity = position, velocity
            self._go_on()
            yield
            self._look(k)
        self._drive.velocity = np.zeros(self._drive.spec.dof)

    def _settle(self, end: Array, tolerance: float) -> Iterator[None]:
        for k in range(round(_SETTLE_TIME / TIMESTEP)):
            error, speed = np.abs(self._drive.positions - end), np.abs(self._drive.velocities).max()
            if error.max() < tolerance and speed < _REST_SPEED:
                return
            self._go_on()
            yield
            self._look(k)
        raise self._failure("stalled", "rad short of the end", np.abs(self._drive.positions - end), tolerance)

    def _look(self, step: int) -> None:
        """Every few steps: is the arm where it should be, and does anything push it?"""
        if step % _LOOK_EVERY:
            return
        outside = self._drive.outside_torque
        self._pressed = self._pressed + 1 if (outside > self._outside_limit).any() else 0
        if self._pressed >= _LOOKS_IN_CONTACT:
            raise self._failure("contact", "Nm from outside", outside, self._outside_limit)
        lag = np.abs(self._drive.positions - self._drive.target)
        if lag.max() > TRACKING_LIMIT:
            raise self._failure("tracking", "rad behind its set-point", lag, TRACKING_LIMIT)

    def _failure(self, code: str, what: str, values: Array, limits: Any) -> MotionError:
        limits = np.broadcast_to(limits, values.shape)
        worst = int((values / limits).argmax())
        joint, value, limit = self._drive.spec.joints[worst], float(values[worst]), float(limits[worst])
        message = f"The arm stopped ({code}): {joint} {value:.3f} {what}, limit {limit:.3f}."
        return MotionError(code, message, detail={"joint": joint, "value": value, "limit": limit})

    def braking(self, *, from_measured: bool) -> Iterator[None]:
        """Slow all joints down together within their acceleration limits, then hold; yields whenever physics steps."""
        drive = self._drive
        if from_measured:
            drive.target, drive.velocity = drive.positions, drive.velocities
        start = drive.velocity
        steps = int(np.ceil((np.abs(start) / self._acceleration).max() / TIMESTEP))
        for k in range(steps):
            drive.velocity = start * (1 - (k + 1) / steps)
            drive.target = drive.target + drive.velocity * TIMESTEP
            yield
        drive.velocity = np.zeros(drive.spec.dof)
