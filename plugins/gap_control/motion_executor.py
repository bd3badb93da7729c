"""Carries out commands of one arm or of several, as processes that yield once per control period they wait for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gap_control.joint_controller import JointController
from gap_control.trajectory_follower import TrajectoryFollower
from gap_runtime.contracts.arm import Setpoint
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.simulator import Process
from gap_runtime.contracts.types import Trajectory


class MotionExecutor:
    """The motion of one arm, if any is under way. Lives on the thread of the cell's control loop."""

    def __init__(self, controller: JointController) -> None:
        self.controller = controller
        self.motion: TrajectoryFollower | None = None

    def update(self) -> None:
        """After every control period: let the motion under way, if any, write its next set-point."""
        if self.motion is not None:
            self.motion.advance()

    def begin(self, motion: TrajectoryFollower) -> None:
        """Follow a motion, from the next control period on."""
        self.motion = motion
        motion.advance()

    def clear(self) -> None:
        """Forget the motion, in a new episode."""
        self.motion = None

    def setpoint(self) -> Setpoint:
        """Where the servos want the joints, and where the motion under way ends."""
        motion, applied = self.motion, self.controller.applied
        return Setpoint(*applied, motion.goal if motion is not None and motion.active else applied.positions)

    def finish(self) -> Process[None]:
        """Let a motion that was started come to its end. Raises its `MotionError`, unless it was told to stop."""
        motion = self.motion
        if motion is None:
            return
        while not motion.done:
            yield
        self.motion = None
        if motion.failure is None or motion.stopped():
            return
        error = motion.failure
        raise MotionError(
            error.code,
            f"The motion started at {motion.started:.2f} s of world time failed: {error.message}",
            hint="The command that says so has not begun.",
            detail={**error.detail, "started_s": round(motion.started, 3)},
        ) from error

    def raise_failure(self) -> Process[None]:
        """Raise the failure of a motion that was started, if it has one by now, once the arm is at rest."""
        if self.motion is not None and self.motion.failure and not self.motion.stopped():
            yield from self.finish()


@dataclass(frozen=True)
class Command:
    """A trajectory for one arm. `stopped` says whether the arm was told to stop since the command was given."""

    executor: MotionExecutor
    trajectory: Trajectory
    tolerance: float
    stopped: Callable[[], bool]

    def motion(self, *, takeover: bool = False) -> TrajectoryFollower:
        """Its motion, checked. Raises `MotionError` (`refused`)."""
        return TrajectoryFollower(
            self.executor.controller, self.trajectory, self.tolerance, self.stopped, takeover=takeover
        )


def execute(commands: Sequence[Command]) -> Process[None]:
    """Carry out all commands at the same time. Raises `MotionError`, once every one of these arms has come to rest.

    When one arm fails, all of them stop. Every control period moves all of them.
    """
    for command in commands:
        yield from command.executor.finish()
    motions = [command.motion() for command in commands]
    for command, motion in zip(commands, motions, strict=True):
        command.executor.begin(motion)
    while any(not motion.done for motion in motions):
        yield
        if any(motion.failure for motion in motions):
            for motion in motions:
                motion.end()
    for command in commands:
        command.executor.clear()
    for motion in motions:
        if motion.failure:
            raise motion.failure


def start(command: Command, *, replace: bool) -> Process[None]:
    """Begin a command and leave it under way. Raises `MotionError` (`refused`, or that of an earlier one)."""
    executor = command.executor
    if not (replace and executor.motion is not None and executor.motion.active):
        yield from executor.finish()
    executor.begin(command.motion(takeover=replace))
