"""The gripper of one simulated arm as skills meet it: the `Gripper` contract, from any thread."""

from __future__ import annotations

from collections.abc import Callable

from gap_control.motion_executor import MotionExecutor
from gap_mujoco.control.parallel_gripper import ParallelGripper
from gap_mujoco.thread import SimulatorThread
from gap_runtime.contracts.robot import GripperSpec
from gap_runtime.contracts.simulator import Process, SteppedClock
from gap_runtime.contracts.types import GripperState


class MujocoGripper:
    """A parallel jaw. `stop_flag` makes what says whether the arm was told to stop since."""

    def __init__(
        self,
        gripper: ParallelGripper,
        executor: MotionExecutor,
        thread: SimulatorThread,
        clock: SteppedClock,
        stop_flag: Callable[[], Callable[[], bool]],
    ) -> None:
        self._gripper, self._executor, self._stop_flag = gripper, executor, stop_flag
        self._thread, self._clock = thread, clock

    @property
    def spec(self) -> GripperSpec:
        """Its range, force and shape."""
        return self._gripper.spec

    def state(self) -> GripperState:
        """Opening and squeezing force."""
        return self._thread.call(self._gripper.state)

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
        return self._clock.run(self._move(width, force, settle if wait else None, self._stop_flag()))

    def set_force(self, force: float) -> GripperState:
        """Squeeze with at most `force` [N] from now on."""
        return self._clock.run(self._set_force(force))

    def _move(
        self, width: float, force: float | None, settle: float | None, stopped: Callable[[], bool]
    ) -> Process[GripperState]:
        yield from self._executor.raise_failure()
        yield from self._gripper.move(width, force, settle, stopped)
        return self._gripper.state()

    def _set_force(self, force: float) -> Process[GripperState]:
        yield from self._executor.raise_failure()
        self._gripper.set_force(force)
        return self._gripper.state()
