"""One simulated arm as skills meet it: the `Arm` contract, from any thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from gap_control import motion_executor
from gap_control.motion_executor import Command, MotionExecutor
from gap_mujoco.control.joint_controller import MujocoJointController
from gap_mujoco.gripper import MujocoGripper
from gap_mujoco.physics import Physics
from gap_mujoco.thread import SimulatorThread
from gap_runtime.contracts.arm import Compliance, ContactMotion, Setpoint
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import SteppedClock
from gap_runtime.contracts.task import RobotPlacement
from gap_runtime.contracts.types import ArmState, Quaternion, Se3Pose, Trajectory, Vec3, Wrench


class MujocoArm:
    """An `Arm`. It moves by its actuators alone, within their torque limits."""

    def __init__(
        self,
        index: int,
        spec: RobotSpec,
        placement: RobotPlacement,
        physics: Physics,
        thread: SimulatorThread,
        clock: SteppedClock,
    ) -> None:
        self.controller = MujocoJointController(index, spec, placement, physics)
        self.executor = MotionExecutor(self.controller)
        self._physics, self._thread, self._clock = physics, thread, clock
        half = np.radians(placement.yaw_deg) / 2
        rotation = Quaternion(float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
        self._base = Se3Pose(Vec3.of(placement.position), rotation)
        self._stops, self._lock = 0, threading.Lock()
        self.gripper = MujocoGripper(self.controller.gripper, self.executor, thread, clock, self.stop_flag)

    @property
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""
        return self.controller.spec

    @property
    def base_pose(self) -> Se3Pose:
        """T_world_base."""
        return self._base

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics."""
        return self._thread.call(self.controller.state)

    def setpoint(self) -> Setpoint:
        """Where the servos want the joints now."""
        return self._thread.call(self.executor.setpoint)

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Track a joint trajectory; see `gap_runtime.contracts.arm.Arm.execute`."""
        self._clock.run(motion_executor.execute([self.command(trajectory, tolerance)]))

    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin to track a joint trajectory; see `gap_runtime.contracts.arm.Arm.start`."""
        self._physics.require_placed()
        self._clock.run(motion_executor.start(self.command(trajectory, tolerance), replace=replace))

    def finish(self) -> None:
        """Let a motion that was started come to its end; see `gap_runtime.contracts.arm.Arm.finish`."""
        self._clock.run(self.executor.finish())

    def wrench(self) -> Wrench:
        """Not simulated yet."""
        raise _unsupported("has no force-torque sensor")

    def move_guarded(self, trajectory: Trajectory, *, force: float, tolerance: float = 0.01) -> ContactMotion:
        """Not simulated yet."""
        raise _unsupported("has no force-torque sensor")

    def move_compliant(
        self, target: Se3Pose, compliance: Compliance, *, force_limit: float, timeout: float, speed: float = 0.05
    ) -> ContactMotion:
        """Not simulated yet."""
        raise _unsupported("cannot move compliantly")

    def stop(self) -> None:
        """End the command under way and those already asked for, and hold. Later commands are not affected."""
        with self._lock:
            self._stops += 1

    def place_home(self) -> None:
        """Write the home configuration and hold it. Only a reset may."""
        self.executor.clear()
        self.controller.place_home()

    def command(self, trajectory: Trajectory, tolerance: float) -> Command:
        """A command of this arm, which `stop` ends if it is called from now on. For the simulator's own use."""
        return Command(self.executor, trajectory, tolerance, self.stop_flag())

    def stop_flag(self) -> Callable[[], bool]:
        """Whether the arm was told to stop since now. For the simulator's own use."""
        seen = self._stops
        return lambda: self._stops != seen


def _unsupported(what: str) -> MotionError:
    return MotionError("unsupported", f"The simulated arm {what}.")
