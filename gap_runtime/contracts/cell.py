"""A robot cell: cameras, arms, grippers, a clock and stop. What tools reach; a simulator is one (simulator.py)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.types import ArmState, Array, GripperState, Observation, Se3Pose, Trajectory


@dataclass(frozen=True)
class CellFrame:
    """What a recorder sees at one instant of cell time: sensors, plus a simulator's ground truth for drawing only."""

    time: float
    observation: Observation
    snapshot: WorldSnapshot | None


@dataclass(frozen=True)
class Setpoint:
    """Where an arm's controller wants its joints at this instant [rad, rad/s, rad/s^2], and where the motion under way
    ends (`goal` [rad]; the positions when none is); shapes (n,)."""

    positions: Array
    velocities: Array
    accelerations: Array
    goal: Array


class Arm(Protocol):
    """One arm and its gripper. Every motion blocks until done in world time and raises `MotionError` on trouble.

    Except `start`: what it began goes on whenever world time passes, inside whatever command lets it pass. An `execute`
    or `start` of the same arm waits for its end; its failure is raised by the arm's next command, jaws included,
    before that begins.
    """

    @property
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""

    @property
    def base_pose(self) -> Se3Pose:
        """T_world_base: known cell calibration."""

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics as the arm's own sensors report them."""

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Track a joint trajectory that starts at the current positions; done when within `tolerance` [rad] of its end.

        The whole command is refused (`MotionError` code `refused`) where it is not finite, does not start where the
        arm is, or leaves the robot's limits. Codes while moving: `tracking`, `contact`, `stalled`, `stopped`; the arm
        is at rest when one is raised, and after a contact no longer presses on what it met.
        """

    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin what `execute` does and return at once, or once the motion under way is over; refused as `execute` is.

        With `replace` it takes over from a motion under way instead of waiting for its end: the trajectory then begins
        at `setpoint`, moving as that moves.
        """

    def finish(self) -> None:
        """Let world time pass until what was started is done; at once when nothing was. Raises its `MotionError`."""

    def setpoint(self) -> Setpoint:
        """Where the controller wants the joints now: what a trajectory that takes over must begin with."""

    def set_gripper(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Drive the jaws to `width` [m] with at most `force` [N] and let `settle` [s] of world time pass.

        With `wait` false it returns at once; the jaws go on whenever world time passes.
        """

    def stop(self) -> None:
        """Stop inside the limits and hold. Safe to call from any thread, at any time, repeatedly.

        From speed v a joint takes v/a to rest and v^2/2a on the way, and what its jerk limit adds; all joints take as
        long as the slowest.

        It ends what was started too, and forgets its failure; world time must pass for the arm to come to rest.
        """


class Cell(Protocol):
    """What a robot cell offers. Methods may be called from any thread; the cell serialises them."""

    @property
    def arms(self) -> Sequence[Arm]:
        """By arm_id."""

    @property
    def real_time(self) -> bool:
        """True where time passes by itself (a robot); false where it is stepped (a simulator)."""

    @property
    def time(self) -> float:
        """Cell time [s]: simulated time, or the cell's monotonic clock."""

    @property
    def camera_names(self) -> tuple[str, ...]:
        """All cameras, robot-mounted ones included, in a fixed order."""

    def observe(self, cameras: Sequence[str] | None = None) -> Observation:
        """RGB-D of the named cameras (default all) and the arms' states, all at one instant."""

    def camera_pose(self, name: str) -> Se3Pose:
        """T_world_camera (optical) from calibration and forward kinematics. Raises `UnknownNameError`."""

    def wait(self, seconds: float) -> None:
        """Let world time pass."""

    def subscribe(
        self, listener: Callable[[CellFrame], None], hz: float, cameras: Sequence[str] = ()
    ) -> Callable[[], None]:
        """Call `listener` at `hz` of world time while it passes; returns how to unsubscribe. Changes no physics."""

    def close(self) -> None:
        """Free everything. Idempotent."""


@runtime_checkable
class LockstepCell(Protocol):
    """A cell whose arms can move together; whoever moves several at once asks for it."""

    def execute(self, motions: Mapping[int, Trajectory], *, tolerance: float = 0.01) -> None:
        """Track one trajectory per arm_id at the same time; done, refused and failing as `Arm.execute` is.

        When one arm fails, all of them stop.
        """
