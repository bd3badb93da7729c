"""Follows one commanded trajectory with one arm, notices when it does not, and comes to rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any

import numpy as np

from gap_control.contact_reaction import MotionHistory, come_to_rest, react_to_contact
from gap_control.joint_controller import JointController
from gap_control.setpoints import Setpoints, refused, setpoints
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Array, Trajectory

TRACKING_LIMIT = 0.1  # [rad] a joint may lag behind its set-point
MONITOR_PERIOD = 0.01  # [s] between checks of tracking and external torque
_CHECKS_IN_CONTACT = 2  # in a row before it counts, so that a tap does not
_REST_SPEED = 0.03  # [rad/s]
_SETTLE_TIME = 1.0  # [s] granted after the last set-point


class TrajectoryFollower:
    """One command. Its next set-point is always written before a control period begins; `advance` is called after each.

    `done` once the arm is at rest, at the end or, with a `failure`, where it stopped. `stopped` says whether the arm
    was told to stop since the command was given. With `takeover` it goes on from the set-point under way.
    """

    def __init__(
        self,
        controller: JointController,
        trajectory: Trajectory,
        tolerance: float,
        stopped: Callable[[], bool],
        *,
        takeover: bool = False,
    ) -> None:
        if not 0 < tolerance < 1:
            raise refused(f"a tolerance of {tolerance} rad is outside 0 to 1 rad")
        points = setpoints(
            trajectory, controller.spec, controller.clock.period, controller.positions, controller.target,
            controller.applied if takeover else None,
        )  # fmt: skip
        self._controller, self.stopped = controller, stopped
        self.started, self.done = controller.clock.time, False
        self.failure: MotionError | None = None
        self.goal: Array = points.positions[-1]  # [rad]
        self._ended, self._in_contact, self._history = False, 0, MotionHistory(controller)
        self._monitor_every = max(1, round(MONITOR_PERIOD / controller.clock.period))
        self._periods: Iterator[None] = chain(self._follow(points), self._settle(self.goal, tolerance))

    @property
    def active(self) -> bool:
        """True while it is on its way, and nothing has told it to come to rest."""
        return not (self.done or self._ended or self.stopped())

    def advance(self) -> None:
        """Check what the last control period did, and write the next set-point."""
        if self.done:
            return
        try:
            next(self._periods)
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
        self._periods = react_to_contact(self._controller, self._history) if blocked else come_to_rest(self._controller)
        self.advance()

    def _follow(self, points: Setpoints) -> Iterator[None]:
        for k, (position, velocity) in enumerate(zip(*points, strict=True)):
            self._controller.set_target(position, velocity)
            self._raise_if_stopped()
            yield
            self._monitor(k)
        self._controller.set_target(self._controller.target, np.zeros(self._controller.spec.dof))

    def _settle(self, end: Array, tolerance: float) -> Iterator[None]:
        for k in range(round(_SETTLE_TIME / self._controller.clock.period)):
            error, speed = np.abs(self._controller.positions - end), np.abs(self._controller.velocities).max()
            if error.max() < tolerance and speed < _REST_SPEED:
                return
            self._raise_if_stopped()
            yield
            self._monitor(k)
        raise self._failure("stalled", "rad short of the end", np.abs(self._controller.positions - end), tolerance)

    def _raise_if_stopped(self) -> None:
        if self.stopped():
            raise MotionError("stopped", "The arm was told to stop.")

    def _monitor(self, period: int) -> None:
        """Every few control periods: is the arm where it should be, and does anything push it?"""
        if period % self._monitor_every:
            return
        self._history.record()
        external, limit = self._controller.external_torque, self._controller.contact_torque
        self._in_contact = self._in_contact + 1 if (external > limit).any() else 0
        if self._in_contact >= _CHECKS_IN_CONTACT:
            raise self._failure("contact", "Nm from outside", external, limit)
        lag = np.abs(self._controller.positions - self._controller.target)
        if lag.max() > TRACKING_LIMIT:
            raise self._failure("tracking", "rad behind its set-point", lag, TRACKING_LIMIT)

    def _failure(self, code: str, what: str, values: Array, limits: Any) -> MotionError:
        limits = np.broadcast_to(limits, values.shape)
        worst = int((values / limits).argmax())
        joint, value, limit = self._controller.spec.joints[worst], float(values[worst]), float(limits[worst])
        message = f"The arm stopped ({code}): {joint} {value:.3f} {what}, limit {limit:.3f}."
        return MotionError(code, message, detail={"joint": joint, "value": value, "limit": limit})
