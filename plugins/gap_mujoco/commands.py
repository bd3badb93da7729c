"""Carries out commands of one arm or of several on one clock: what was started earlier ends first, then they begin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gap_mujoco.control.joint_controller import Drive
from gap_mujoco.control.trajectory_follower import Motion
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.types import Trajectory


@dataclass(frozen=True)
class Command:
    """A trajectory for one arm. `stopped` says whether the arm was told to stop since the command was given."""

    drive: Drive
    trajectory: Trajectory
    tolerance: float
    stopped: Callable[[], bool]

    def motion(self, *, flying: bool = False) -> Motion:
        """Its motion, checked; `flying` takes over from the set-point under way. Raises `MotionError` (`refused`)."""
        return Motion(self.drive, self.trajectory, self.tolerance, self.stopped, flying=flying)


def execute(commands: Sequence[Command]) -> None:
    """Carry out all commands at the same time. Raises `MotionError`, once every one of these arms has come to rest.

    When one arm fails, all of them stop. Every physics step moves all of them.
    """
    for command in commands:
        finish(command.drive)
    motions = [command.motion() for command in commands]
    for command, motion in zip(commands, motions, strict=True):
        command.drive.begin(motion)
    while any(not motion.done for motion in motions):
        commands[0].drive.physics.step()
        if any(motion.failure for motion in motions):
            for motion in motions:
                motion.end()
    for command in commands:
        command.drive.motion = None
    for motion in motions:
        if motion.failure:
            raise motion.failure


def start(command: Command, *, replace: bool) -> None:
    """Begin a command and leave it under way. Raises `MotionError` (`refused`, or that of an earlier one)."""
    drive = command.drive
    drive.physics.require_placed()
    earlier = drive.motion
    if not (replace and earlier is not None and earlier.going_on):
        finish(drive)
    drive.begin(command.motion(flying=replace))


def finish(drive: Drive) -> None:
    """Let a motion that was started come to its end. Raises its `MotionError`, unless it was told to stop."""
    motion = drive.motion
    if motion is None:
        return
    while not motion.done:
        drive.physics.step()
    drive.motion = None
    if motion.failure is None or motion.stopped():
        return
    error = motion.failure
    raise MotionError(
        error.code,
        f"The motion started at {motion.begun:.2f} s of world time failed: {error.message}",
        hint="The command that says so has not begun.",
        detail={**error.detail, "started_s": round(motion.begun, 3)},
    ) from error


def report(drive: Drive) -> None:
    """Raise the failure of a motion that was started, if it has one by now, once the arm is at rest."""
    motion = drive.motion
    if motion is not None and motion.failure and not motion.stopped():
        finish(drive)
