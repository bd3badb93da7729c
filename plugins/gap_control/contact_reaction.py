"""After a contact: the arm comes to rest, stops pressing, and if it is still pushed retracts the way it came."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from gap_control.joint_controller import JointCommand, JointController
from gap_control.point_to_point import point_to_point
from gap_control.setpoints import setpoints
from gap_control.stop_trajectory import stop_trajectory
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Array

RETRACT_DISTANCE = 0.010  # [m] of the TCP, at most
RELEASED_SHARE = 0.2  # of the contact torque: with that much left the arm need not retract further
_BLOCKED_SPEED = 0.05  # [rad/s]: something else has stopped the arm
_RELEASE_TIME = 0.05  # [s] for the force to go once the arm no longer presses
_HISTORY = 100  # configurations that are remembered


class MotionHistory:
    """Where the arm has just been: measured joints (n,) and TCP (3,), oldest first."""

    def __init__(self, controller: JointController) -> None:
        self._controller = controller
        self._entries: deque[tuple[Array, Array]] = deque(maxlen=_HISTORY)

    def record(self) -> None:
        """Remember this instant."""
        self._entries.append((self._controller.positions.copy(), self._controller.tcp().position.array))

    def configuration_before(self, distance: float) -> Array | None:
        """The last joints (n,) at which the TCP was `distance` [m] from here, or the oldest known; None for none."""
        here = self._controller.tcp().position.array
        for joints, tcp in reversed(self._entries):
            if np.linalg.norm(tcp - here) >= distance:
                return joints
        return self._entries[0][0] if self._entries else None


def react_to_contact(controller: JointController, history: MotionHistory) -> Iterator[None]:
    """Yields once per control period. At most a stop, then `RETRACT_DISTANCE` at half the joints' limits."""
    period, still = controller.clock.period, np.zeros(controller.spec.dof)
    measured = JointCommand(controller.positions, controller.velocities, still)
    for slower in stop_trajectory(controller.spec, period, measured).velocities:
        if np.abs(controller.velocities).max() < _BLOCKED_SPEED:
            break
        velocity = _no_faster(slower, controller.velocities)  # so that it never pushes against what slows it down
        controller.set_target(controller.positions + velocity * period, velocity)
        yield
    for _ in range(round(_RELEASE_TIME / period)):
        controller.set_target(controller.positions, still)
        yield
    if _is_pushed(controller):
        yield from _retract(controller, history)


def _no_faster(wanted: Array, measured: Array) -> Array:
    """The wanted velocities (n,), brought down to the measured ones in size, and to zero where those are reversed."""
    size = np.minimum(np.abs(wanted), np.maximum(np.sign(wanted) * measured, 0.0))
    return np.asarray(np.sign(wanted) * size)


def _retract(controller: JointController, history: MotionHistory) -> Iterator[None]:
    goal, spec, period = history.configuration_before(RETRACT_DISTANCE), controller.spec, controller.clock.period
    if goal is None:
        return
    low, high = (np.array([getattr(x, k) for x in spec.limits]) for k in ("lower", "upper"))
    start = np.clip(controller.positions, low, high)
    try:
        way = point_to_point(spec, start, np.clip(goal, low, high))
        points = setpoints(way, spec, period, start, controller.target)
    except MotionError:
        return  # what is too far out of its range to be led back stays where it is
    for position, velocity in zip(*points, strict=True):
        controller.set_target(position, velocity)
        yield
        if not _is_pushed(controller):
            break
    yield from come_to_rest(controller)


def come_to_rest(controller: JointController) -> Iterator[None]:
    """Yields once per control period of a stop inside the limits."""
    for position, velocity in zip(
        *stop_trajectory(controller.spec, controller.clock.period, controller.applied), strict=True
    ):
        controller.set_target(position, velocity)
        yield
    controller.set_target(controller.target, np.zeros(controller.spec.dof))


def _is_pushed(controller: JointController) -> bool:
    return bool((controller.external_torque > RELEASED_SHARE * controller.contact_torque).any())
