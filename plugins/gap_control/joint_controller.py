"""What following a trajectory needs of an arm's joints and of its cell's clock, whether simulated or real."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Se3Pose


class JointCommand(NamedTuple):
    """What the servos were given for the last control period, shapes (n,): [rad], [rad/s], [rad/s^2]."""

    positions: Array
    velocities: Array
    accelerations: Array


class ControlClock(Protocol):
    """The control loop of a cell. Everything here runs on its thread."""

    @property
    def time(self) -> float:
        """Cell time [s]."""

    @property
    def period(self) -> float:
        """Of the control loop [s]: servos take one set-point per period."""


class JointController(Protocol):
    """Position servos of one arm's joints, and what its own sensors report; shapes (n,)."""

    @property
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""

    @property
    def clock(self) -> ControlClock:
        """The cell's control loop."""

    @property
    def positions(self) -> Array:
        """Measured [rad]."""

    @property
    def velocities(self) -> Array:
        """Measured [rad/s]."""

    @property
    def external_torque(self) -> Array:
        """Size of what contacts exert on the joints [Nm]."""

    @property
    def contact_torque(self) -> Array:
        """The external torque beyond which it is a collision [Nm]."""

    @property
    def target(self) -> Array:
        """The set-point of the next period [rad]."""

    @property
    def applied(self) -> JointCommand:
        """The set-point of the last period."""

    def tcp(self) -> Se3Pose:
        """T_world_tcp by forward kinematics."""

    def set_target(self, positions: Array, velocities: Array) -> None:
        """The set-point of the next period: joints [rad] and their velocities [rad/s] at its end."""
