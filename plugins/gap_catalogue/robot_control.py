"""Commands that move arms: `robot_control.*`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import WORLD, ActionChunk, JointState, Se3Pose, Trajectory, Vec3

ARM, BOTH = ("arm:0", "clock"), ("arm:0", "arm:1", "clock")
ARM_AND_GRIPPER = ("arm:{arm_id}", "gripper:{arm_id}", "clock")
MAX_RATE = 100.0  # Hz: of a chunk's targets, each of which is a motion planned anew


class TcpPose(NamedTuple):
    """A pose of the TCP."""

    pose: Annotated[Se3Pose, WORLD]


class GetEEPose(ToolRequest[TcpPose], tool="robot_control.GetEEPose", effect="sense"):
    """T_world_tcp of one arm now, from its joint sensors."""

    arm_id: int = 0


class GoToPose(ToolRequest[None], tool="robot_control.GoToPose", effect="actuate", resources=ARM, deadline_s=60.0):
    """Move the TCP to a pose by joint motion to the nearest IK solution, with no collision avoidance.

    With `z_approach` [m] it first goes to the pose backed off by that much along the TCP's approach axis, then straight
    in. `tcp_offset` [m] is the flange seen from the TCP, along the TCP's axes; by default the robot's own TCP is meant.
    Done when every joint is within `tolerance` [rad]. One of `max_steps` is 50 ms of planned motion.

    With `nonblocking` it returns when the arm begins to move, and lets go of the arm. The arm then moves whenever world
    time passes: while the jaws open or close, while another arm moves, while something waits. Time does not pass while
    a policy computes or looks, so that is all it gains. The arm's next motion command first lets this one end; if it
    failed, the arm's next command raises that failure instead of beginning.
    Raises `BadRequestError`, `PlanningError` (`unreachable`, `limits`, `no_path`, `budget`), `MotionError`.
    """

    pose: Annotated[Se3Pose, WORLD]
    z_approach: float = 0.0
    tcp_offset: Vec3 | None = None
    tolerance: float = 0.01
    max_steps: int = 120
    nonblocking: bool = False


class GoToPoseCartesian(
    ToolRequest[None], tool="robot_control.GoToPoseCartesian", effect="actuate", resources=ARM, deadline_s=60.0
):
    """Move the TCP along a straight line to a pose, turning at a constant axis, with no collision avoidance.

    `lin_vel_norm` [m/s] and `ang_vel_norm` [rad/s] bound the TCP's speed; the joints' own limits may make it slower.
    Refused before it starts when it would take longer than `timeout_s` [s].
    Raises `BadRequestError`, `PlanningError` (`unreachable`, `limits`, `no_path`, `budget`), `MotionError`.
    """

    pose: Annotated[Se3Pose, WORLD]
    lin_vel_norm: float = 1.0
    ang_vel_norm: float = 2.0
    timeout_s: float = 20


class ExecuteJointTrajectory(
    ToolRequest[None], tool="robot_control.ExecuteJointTrajectory", effect="actuate", resources=ARM, deadline_s=120.0
):
    """Track a planned joint trajectory that starts where the arm is; done within `tolerance` [rad] of its end.

    Of its points only every `subsample`-th is kept, and the last. Raises `BadRequestError`, `MotionError` (`refused`
    when it leaves a limit or the workspace; nothing has moved then).
    """

    trajectory: Trajectory
    subsample: int = 1
    tolerance: float = 0.01


class MoveToJoints(
    ToolRequest[None], tool="robot_control.MoveToJoints", effect="actuate", resources=ARM, deadline_s=60.0
):
    """Move straight in joint space to a configuration, as fast as the limits allow, with no collision avoidance.

    One of `max_steps` is 50 ms of planned motion. Raises `BadRequestError`, `PlanningError` (`budget`), `MotionError`.
    """

    joint_config: JointState
    tolerance: float = 0.01
    max_steps: int = 120


class GoHome(ToolRequest[None], tool="robot_control.GoHome", effect="actuate", resources=BOTH, deadline_s=60.0):
    """Move straight in joint space to the home configuration, the task's or else the robot's own; two arms together.

    Raises `MotionError`.
    """


class GoToPoseArm(
    ToolRequest[None],
    tool="robot_control.GoToPoseArm",
    effect="actuate",
    resources=("arm:{arm_id}", "clock"),
    deadline_s=60.0,
):
    """Move one arm's TCP to a pose by joint motion to the nearest IK solution, with no collision avoidance.

    Arguments as in GoToPose. Raises `BadRequestError` (`unknown_arm`, ...), `PlanningError`, `MotionError`.
    """

    arm_id: int
    pose: Annotated[Se3Pose, WORLD]
    z_approach: float = 0.0
    tcp_offset: Vec3 | None = None


class GoToPoseBoth(
    ToolRequest[None], tool="robot_control.GoToPoseBoth", effect="actuate", resources=BOTH, deadline_s=60.0
):
    """Move the TCPs of arms 0 and 1 to their poses at the same time, in lock-step: both start and end together.

    Arguments as in GoToPose. Refused when the arms would meet. Raises `BadRequestError`, `PlanningError`,
    `MotionError`.
    """

    pose_arm0: Annotated[Se3Pose, WORLD]
    pose_arm1: Annotated[Se3Pose, WORLD]
    z_approach: float = 0.0
    tcp_offset: Vec3 | None = None


class MoveToJointsBoth(
    ToolRequest[None], tool="robot_control.MoveToJointsBoth", effect="actuate", resources=BOTH, deadline_s=60.0
):
    """Move arms 0 and 1 straight in joint space to configurations at the same time, in lock-step.

    One of `max_steps` is 50 ms of planned motion. Refused when the arms would meet. Raises `BadRequestError`,
    `PlanningError` (`budget`), `MotionError`.
    """

    joints_arm0: JointState
    joints_arm1: JointState
    tolerance: float = 0.02
    max_steps: int = 300


class ApplyPolicyAction(
    ToolRequest[None], tool="robot_control.ApplyPolicyAction", effect="actuate", resources=ARM_AND_GRIPPER
):
    """Carry out one action of a policy at 20 Hz: [dx dy dz, rx ry rz, grip], entries in [-1, 1].

    An entry of 1 moves the target of the TCP 5 cm along, or turns it 0.5 rad about, an axis of the arm's base; targets
    add up. The arm is sent on to the target from the motion it is in, inside all limits, to be there 0.15 s later or as
    soon as it can; 50 ms of world time pass, and the next action goes on from there. When none follows, the arm comes
    to rest at the target while time passes or before its next command. Grip below 0 opens, above 0 closes, meanwhile.
    Refused whole outside the arm's limits or the workspace, near another arm, and (`rate`) when the arm would fall 1 s
    behind.
    Raises `BadRequestError`, `PlanningError`, `MotionError`.
    """

    action: list[float]
    arm_id: int = 0


class ExecuteActionChunk(
    ToolRequest[None],
    tool="robot_control.ExecuteActionChunk",
    effect="actuate",
    resources=ARM_AND_GRIPPER,
    deadline_s=60.0,
):
    """Follow the targets of a policy's chunk at its rate, from the motion the arm is in and without stopping between.

    After the last one the arm comes to rest at it, unless the next chunk takes over in time. Refused where
    ApplyPolicyAction is, before the first target that cannot be followed. Raises `BadRequestError` (`range`, `shape`),
    `PlanningError`, `MotionError`.
    """

    chunk: ActionChunk
    arm_id: int = 0

    def __post_init__(self) -> None:
        rate, opening = self.chunk.rate, self.chunk.gripper
        if not 0 < rate <= MAX_RATE:
            raise BadRequestError("range", f"chunk.rate is {rate:g} Hz; it must be above 0 and at most {MAX_RATE:g}.")
        if self.chunk.joints is not None and self.chunk.poses:
            raise BadRequestError("shape", "The chunk holds joints and poses; one of them can be followed.")
        if opening is None:
            return
        if opening.shape != (self.targets,) or not ((opening >= 0) & (opening <= 1)).all():
            raise BadRequestError(
                "range", f"chunk.gripper must hold {self.targets} openings between 0 (closed) and 1 (open)."
            )

    @property
    def targets(self) -> int:
        """How many targets there are."""
        return len(self.chunk.poses) if self.chunk.joints is None else len(self.chunk.joints)
