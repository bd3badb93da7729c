"""One simulated arm as skills meet it: the `Arm` contract, from any thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from gap_mujoco import commands
from gap_mujoco.control.joint_controller import Drive
from gap_mujoco.gripper import SimGripper
from gap_mujoco.thread import WorldThread
from gap_runtime.contracts.arm import Compliance, ContactMotion, Setpoint
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import RobotPlacement
from gap_runtime.contracts.types import ArmState, Quaternion, Se3Pose, Trajectory, Vec3, Wrench


class SimArm:
    """An `Arm`. It moves by its position actuators alone, within their torque limits."""

    def __init__(self, drive: Drive, placement: RobotPlacement, thread: WorldThread) -> None:
        self._drive, self._thread = drive, thread
        half = np.radians(placement.yaw_deg) / 2
        rotation = Quaternion(float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
        self._base = Se3Pose(Vec3.of(placement.position), rotation)
        self._stops, self._lock = 0, threading.Lock()
        self.gripper = SimGripper(drive, thread, self.stop_flag)

    @property
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""
        return self._drive.spec

    @property
    def base_pose(self) -> Se3Pose:
        """T_world_base."""
        return self._base

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics."""
        return self._thread.call(self._drive.state)

    def setpoint(self) -> Setpoint:
        """Where the servos want the joints now."""
        return self._thread.call(self._drive.setpoint)

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Track a joint trajectory; see `gap_runtime.contracts.cell.Arm.execute`."""
        self._thread.call(commands.execute, [self.command(trajectory, tolerance)])

    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin to track a joint trajectory; see `gap_runtime.contracts.cell.Arm.start`."""
        self._thread.call(commands.start, self.command(trajectory, tolerance), replace=replace)

    def finish(self) -> None:
        """Let a motion that was started come to its end; see `gap_runtime.contracts.cell.Arm.finish`."""
        self._thread.call(commands.finish, self._drive)

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

    def command(self, trajectory: Trajectory, tolerance: float) -> commands.Command:
        """A command of this arm, which `stop` ends if it is called from now on. For the world's own use."""
        return commands.Command(self._drive, trajectory, tolerance, self.stop_flag())

    def stop_flag(self) -> Callable[[], bool]:
        """Whether the arm was told to stop since now. For the cell's own use."""
        seen = self._stops
        return lambda: self._stops != seen


def _unsupported(what: str) -> MotionError:
    return MotionError("unsupported", f"The simulated arm {what}.")
