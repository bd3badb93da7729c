"""One simulated arm as skills meet it: the `Arm` contract, from any thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from gap_mujoco import commands
from gap_mujoco.control.joint_controller import Drive
from gap_mujoco.thread import WorldThread
from gap_runtime.contracts.cell import Setpoint
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import RobotPlacement
from gap_runtime.contracts.types import ArmState, GripperState, Quaternion, Se3Pose, Trajectory, Vec3


class SimArm:
    """An `Arm`. It moves by its position actuators alone, within their torque limits."""

    def __init__(self, drive: Drive, placement: RobotPlacement, thread: WorldThread) -> None:
        self._drive, self._thread = drive, thread
        half = np.radians(placement.yaw_deg) / 2
        rotation = Quaternion(float(np.cos(half)), 0.0, 0.0, float(np.sin(half)))
        self._base = Se3Pose(Vec3.of(placement.position), rotation)
        self._stops, self._lock = 0, threading.Lock()

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

    def set_gripper(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Drive the jaws; see `gap_runtime.contracts.cell.Arm.set_gripper`."""
        return self._thread.call(self._set_gripper, width, force, settle if wait else None, self._stopped())

    def _set_gripper(
        self, width: float, force: float | None, settle: float | None, stopped: Callable[[], bool]
    ) -> GripperState:
        commands.report(self._drive)
        self._drive.jaws.move(width, force, settle, stopped)
        return self._drive.jaws.state()

    def stop(self) -> None:
        """End the command under way and those already asked for, and hold. Later commands are not affected."""
        with self._lock:
            self._stops += 1

    def command(self, trajectory: Trajectory, tolerance: float) -> commands.Command:
        """A command of this arm, which `stop` ends if it is called from now on. For the world's own use."""
        return commands.Command(self._drive, trajectory, tolerance, self._stopped())

    def _stopped(self) -> Callable[[], bool]:
        seen = self._stops
        return lambda: self._stops != seen
