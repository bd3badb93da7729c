"""A parallel jaw driven by one actuator named `gripper`: opening [m], bounded in speed and squeezing force."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gap_control.setpoints import refused
from gap_mujoco.physics import Physics
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Process
from gap_runtime.contracts.types import GripperState

DEFAULT_FORCE = 30.0  # [N]: holds 0.5 kg at friction 0.6 against 2 g
_AT_TARGET = 0.0005  # [m]
_STILL = 0.002  # [m/s]: slower than that, the jaws are blocked
_STILL_STEPS = 25
_HOLDING = 0.5  # of the force they squeeze with: less than that comes from reaching a width
_MAX_SETTLE = 10.0  # [s]
_PATIENCE = 1.0  # [s] beyond the time the stroke takes at full speed


class ParallelGripper:
    """The gripper of one arm. Its finger joints slide from 0 (closed) to their upper limit (open).

    The actuator's length is the opening times a constant, so its set-point and force convert by that constant.
    """

    def __init__(self, index: int, spec: RobotSpec, physics: Physics) -> None:
        model = physics.model
        self.spec, self._physics = spec.gripper, physics
        joints = [model.joint(f"arm{index}/{name}") for name in spec.gripper.joints]
        self._q = np.array([j.qposadr[0] for j in joints])
        self._v = np.array([j.dofadr[0] for j in joints])
        self._open = np.array([j.range[1] for j in joints])
        self._actuator = model.actuator(f"arm{index}/gripper").id
        physics.clear()
        physics.data.qpos[self._q] = self._open
        physics.forward()
        self._ratio = float(physics.data.actuator_length[self._actuator]) / spec.gripper.max_width
        self._setpoint = self._target = spec.gripper.max_width
        self._force = DEFAULT_FORCE
        self._stopped: Callable[[], bool] = lambda: False
        self._still = self._waited = 0

    @property
    def width(self) -> float:
        """Measured opening [m]."""
        share = float(np.mean(self._physics.data.qpos[self._q] / self._open))
        return share * self.spec.max_width

    def state(self) -> GripperState:
        """Opening and squeezing force as the gripper's own sensors report them; jaws that squeeze and stand still
        before they are closed hold something."""
        force = -float(self._physics.data.actuator_force[self._actuator]) * self._ratio
        speed = float(np.abs(self._physics.data.qvel[self._v]).sum())
        holding = force > _HOLDING * self._force and self.width > _AT_TARGET if speed < _STILL else None
        return GripperState(self.width, self.width / self.spec.max_width, max(0.0, force), holding)

    def place_open(self) -> None:
        """Write the open position and hold it with the default force. Only a reset may."""
        self._physics.data.qpos[self._q] = self._open
        self._setpoint = self._target = self.spec.max_width
        self._stopped = lambda: False
        self._limit(DEFAULT_FORCE)

    def move(
        self, width: float, force: float | None, settle: float | None, stopped: Callable[[], bool]
    ) -> Process[None]:
        """Drive to `width` [m] with at most `force` [N] until there or blocked, and let `settle` [s] pass.

        With `settle` None only begin. Once `stopped`, they go no further and keep squeezing. Raises `MotionError`:
        `refused` before anything moves, `stopped`.
        """
        if settle is not None and not 0 <= settle <= _MAX_SETTLE:
            raise refused(f"a settle time of {settle} s is outside 0 to {_MAX_SETTLE:.0f} s")
        self._set_target(width, force, stopped)
        if settle is not None:
            while not self._done():
                self._raise_if_stopped()
                yield
            for _ in range(round(settle / self._physics.period)):
                self._raise_if_stopped()
                yield

    def set_force(self, force: float) -> None:
        """Push with at most `force` [N] from now on. Raises `MotionError` (`refused`)."""
        if not 0 < force <= self.spec.max_force:
            raise refused(f"a gripping force of {force} N is outside 0 to {self.spec.max_force} N")
        self._limit(force)

    def _set_target(self, width: float, force: float | None, stopped: Callable[[], bool]) -> None:
        if not 0 <= width <= self.spec.max_width + 1e-9:
            raise refused(f"a jaw opening of {width} m is outside 0 to {self.spec.max_width} m")
        self.set_force(DEFAULT_FORCE if force is None else force)
        if width > self._setpoint:  # what is squeezed keeps the jaws open: start from there, not from the squeeze
            self._setpoint = min(max(self._setpoint, self.width), width)
        self._target, self._stopped = width, stopped
        self._still = self._waited = 0

    def _raise_if_stopped(self) -> None:
        if self._stopped():
            raise MotionError("stopped", "The arm was told to stop.")

    def write_control(self) -> None:
        """Write this step's control: the set-point walks to the target at no more than full speed."""
        if self._stopped():
            self._target = self._setpoint
        step = self.spec.max_speed * self._physics.period
        self._setpoint += float(np.clip(self._target - self._setpoint, -step, step))
        # Fully closed means squeezing: aim past zero, or thin things would be held by a sliver of the force.
        closed = self._setpoint <= 0 and self._target <= 0
        low = self._physics.model.actuator_ctrlrange[self._actuator, 0]
        self._physics.data.ctrl[self._actuator] = low if closed else self._setpoint * self._ratio

    def _done(self) -> bool:
        """True when the jaws are where they should be, or something between them has stopped them."""
        self._waited += 1
        speed = float(np.abs(self._physics.data.qvel[self._v]).sum())
        self._still = self._still + 1 if speed < _STILL else 0
        arrived = abs(self._setpoint - self._target) < 1e-9
        if arrived and abs(self.width - self._target) < _AT_TARGET and self._still:
            return True
        longest = self.spec.max_width / self.spec.max_speed + _PATIENCE
        lagging = abs(self._setpoint - self.width) > _AT_TARGET
        return (lagging and self._still >= _STILL_STEPS) or self._waited * self._physics.period > longest

    def _limit(self, force: float) -> None:
        self._force = force
        self._physics.model.actuator_forcerange[self._actuator] = np.array([-force, force]) / self._ratio
