"""The gripper of one simulated arm as skills meet it: the `Gripper` contract, from any thread."""

from __future__ import annotations

from collections.abc import Callable

from gap_mujoco import commands
from gap_mujoco.control.joint_controller import Drive
from gap_mujoco.thread import WorldThread
from gap_runtime.contracts.robot import GripperSpec
from gap_runtime.contracts.types import GripperState


class SimGripper:
    """A parallel jaw. `stop_flag` makes what says whether the arm was told to stop since."""

    def __init__(self, drive: Drive, thread: WorldThread, stop_flag: Callable[[], Callable[[], bool]]) -> None:
        self.spec: GripperSpec = drive.spec.gripper
        self._drive, self._thread, self._stop_flag = drive, thread, stop_flag

    def state(self) -> GripperState:
        """Opening and squeezing force."""
        return self._thread.call(self._drive.jaws.state)

    def open(self, *, settle: float = 0.5, wait: bool = True) -> GripperState:
        """Open the jaws fully."""
        return self.set_width(self.spec.max_width, settle=settle, wait=wait)

    def close(self, *, force: float | None = None, settle: float = 0.5, wait: bool = True) -> GripperState:
        """Close the jaws until something stops them."""
        return self.set_width(0.0, force=force, settle=settle, wait=wait)

    def set_width(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Drive the jaws; see `gap_runtime.contracts.arm.Gripper.set_width`."""
        return self._thread.call(self._move, width, force, settle if wait else None, self._stop_flag())

    def set_force(self, force: float) -> GripperState:
        """Squeeze with at most `force` [N] from now on."""
        return self._thread.call(self._set_force, force)

    def _move(
        self, width: float, force: float | None, settle: float | None, stopped: Callable[[], bool]
    ) -> GripperState:
        commands.report(self._drive)
        self._drive.jaws.move(width, force, settle, stopped)
        return self._drive.jaws.state()

    def _set_force(self, force: float) -> GripperState:
        commands.report(self._drive)
        self._drive.jaws.squeeze(force)
        return self._drive.jaws.state()
