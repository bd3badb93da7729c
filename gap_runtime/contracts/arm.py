"""An arm, the gripper it carries and what it feels: what every robot's driver and every simulator implements."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal, Protocol

from gap_runtime.contracts.access import access
from gap_runtime.contracts.robot import GripperSpec, RobotSpec
from gap_runtime.contracts.types import TCP, WORLD, ArmState, Array, GripperState, Se3Pose, Trajectory, Vec3, Wrench

NO_WRENCH = Wrench(Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Setpoint:
    """Where an arm's controller wants its joints at this instant [rad, rad/s, rad/s^2], and where the motion under way
    ends (`goal` [rad]; the positions when none is); shapes (n,)."""

    positions: Array
    velocities: Array
    accelerations: Array
    goal: Array


@dataclass(frozen=True)
class Compliance:
    """How an arm gives way, along (x, y, z) and about (rx, ry, rz) the axes of a task frame that stands still.

    task_frame  T_world_task.
    stiffness   what pulls the TCP back to its commanded pose, per axis [N/m, Nm/rad], each >= 0; with 0 an axis is free
                and follows `wrench` alone. Damping is the controller's.
    wrench      what the tool is to exert on what it touches beside that pull: force along, torque about the task
                frame's axes, at the TCP.
    """

    task_frame: Annotated[Se3Pose, WORLD]
    stiffness: tuple[float, float, float, float, float, float]
    wrench: Wrench = field(default_factory=lambda: NO_WRENCH)


@dataclass(frozen=True)
class ContactMotion:
    """How a compliant or guarded motion ended. The arm is at rest: `pose` is T_world_tcp, `wrench` as `Arm.wrench`.

    `reached`: where it was to go. `contact`: held up by what it touches. `timeout`: its time is up.
    """

    reason: Literal["reached", "contact", "timeout"]
    pose: Annotated[Se3Pose, WORLD]
    wrench: Annotated[Wrench, TCP]


class Gripper(Protocol):
    """What an arm holds things with; a parallel jaw is one kind. Commands block until done in cell time.

    They raise `MotionError`: `refused` before anything moves (out of range), `stopped`, `unsupported` where this kind
    of gripper cannot do it. `settle` [s] of cell time pass after the gripper has come to rest. With `wait` false a
    command returns at once and the gripper goes on whenever cell time passes. `Arm.stop` stops the gripper too.
    """

    @property
    @access("pure")
    def spec(self) -> GripperSpec:
        """Its range, force and shape."""

    @access("sense")
    def state(self) -> GripperState:
        """Opening, force, and whether something is held, as far as its own sensors can tell."""

    @access("actuate", "gripper:{arm_id}")
    def open(self, *, settle: float = 0.5, wait: bool = True) -> GripperState:
        """Let go: open fully."""

    @access("actuate", "gripper:{arm_id}")
    def close(self, *, force: float | None = None, settle: float = 0.5, wait: bool = True) -> GripperState:
        """Take hold with at most `force` [N] (default: the gripper's own); it goes on holding afterwards."""

    @access("actuate", "gripper:{arm_id}")
    def set_width(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Drive to an opening of `width` [m] with at most `force` [N], until there or blocked."""

    @access("actuate", "gripper:{arm_id}")
    def set_force(self, force: float) -> GripperState:
        """Hold with at most `force` [N] from now on, towards the opening it was sent to last; takes no time."""


class Arm(Protocol):
    """One arm. Every motion blocks until done in cell time and raises `MotionError` on trouble.

    Except `start`: what it began goes on whenever cell time passes, inside whatever command lets it pass. An `execute`
    or `start` of the same arm waits for its end; its failure is raised by the arm's next command, the gripper's
    included, before that begins.
    """

    @property
    @access("pure")
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""

    @property
    @access("pure")
    def base_pose(self) -> Annotated[Se3Pose, WORLD]:
        """T_world_base: known cell calibration."""

    @property
    @access("pure")
    def gripper(self) -> Gripper:
        """What it carries."""

    @access("sense")
    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics as the arm's own sensors report them."""

    @access("sense")
    def setpoint(self) -> Setpoint:
        """Where the controller wants the joints now: what a trajectory that takes over must begin with."""

    @access("sense")
    def wrench(self) -> Annotated[Wrench, TCP]:
        """What the surroundings exert on the tool and on what it holds: force along the TCP's axes, torque about them
        at the TCP. The tool's own weight is taken out, that of what it holds is not.

        Raises `MotionError` code `unsupported` on an arm that does not feel.
        """

    @access("actuate", "arm:{arm_id}")
    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Track a joint trajectory that starts at the current positions; done when within `tolerance` [rad] of its end.

        The whole command is refused (`MotionError` code `refused`) where it is not finite, does not start where the
        arm is, or leaves the robot's limits. Codes while moving: `tracking`, `contact`, `stalled`, `stopped`; the arm
        is at rest when one is raised, and after a contact no longer presses on what it met.
        """

    @access("actuate", "arm:{arm_id}")
    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin what `execute` does and return at once, or once the motion under way is over; refused as `execute` is.

        With `replace` it takes over from a motion under way instead of waiting for its end: the trajectory then begins
        at `setpoint`, moving as that moves.
        """

    @access("actuate", "arm:{arm_id}")
    def finish(self) -> None:
        """Let cell time pass until what was started is done; at once when nothing was. Raises its `MotionError`."""

    @access("actuate", "arm:{arm_id}")
    def move_guarded(self, trajectory: Trajectory, *, force: float, tolerance: float = 0.01) -> ContactMotion:
        """Execute a joint trajectory until the force on the tool differs by more than `force` [N] from that at its
        start, in whatever direction; then stop inside the limits and press no longer.

        Ends by `reached` or `contact`. Refused and failing as `execute`; `unsupported` on an arm that does not feel.
        """

    @access("actuate", "arm:{arm_id}")
    def move_compliant(
        self,
        target: Annotated[Se3Pose, WORLD],
        compliance: Compliance,
        *,
        force_limit: float,
        timeout: float,
        speed: float = 0.05,
    ) -> ContactMotion:
        """Move the TCP's commanded pose straight to `target` (T_world_tcp) at `speed` [m/s], giving way as `compliance`
        says; the arm then stays stiff where it came to rest.

        Ends by `reached` (there, at rest), `contact` (at rest elsewhere, with the commanded pose at the target) or
        `timeout` [s]. Raises `MotionError`: `refused` (a stiffness, wrench or speed out of range), `force` where the
        tool feels more than `force_limit` [N], `tracking`, `stopped`, `unsupported` on an arm that cannot; the arm
        is at rest when one is raised.
        """

    @access("actuate", always=True)
    def stop(self) -> None:
        """Stop inside the limits and hold. Safe to call from any thread, at any time, repeatedly.

        From speed v a joint takes v/a to rest and v^2/2a on the way, and what its jerk limit adds; all joints take as
        long as the slowest.

        It ends what was started too, and forgets its failure; cell time must pass for the arm to come to rest.
        """
