"""Actions of a learned policy: each moves the target of the TCP, which the arm follows without stopping between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gap_motion.arguments import STEP, ArmModel
from gap_motion.kinematics.damped_least_squares import damped_least_squares
from gap_motion.kinematics.ik import nearest
from gap_motion.timing.timing import SPEED
from gap_runtime.contracts.arm import Setpoint
from gap_runtime.contracts.failures import BadRequestError, MotionError
from gap_runtime.contracts.types import Array, Trajectory

TRANSLATION, ROTATION = 0.05, 0.5  # m, rad that an entry of 1 stands for, as robosuite's OSC_POSE controller scales it
ENTRIES = 7
LAG = 3 * STEP  # s: the arm takes at least that long to a target, so that equal actions make an even speed
MOST_LAG = 1.0  # s: a policy whose target is farther ahead than that asks for more than the arm can do
SHARE = 0.5  # of accelerations and jerks: the rest of the motors' torque is for gravity and what the hand holds
SAMPLE = 0.002  # s between set-points
JUMP = 1.0  # rad: a solution farther away than that is on another branch


@dataclass(frozen=True)
class PolicyStream:
    """What an action of an arm leaves to the next: its target T_base_tcp, and the joints (n,) that are to reach it."""

    target: Array
    goal: Array

    def goes_on(self, now: Setpoint) -> bool:
        """True when the arm has been given nothing else since."""
        return bool(np.array_equal(self.goal, now.goal))


def checked_action(action: Sequence[float]) -> Array:
    """The action (7,). Raises `BadRequestError`: `shape`, `not_finite`, `range` for entries outside [-1, 1]."""
    values = np.asarray(action, dtype=float)
    if values.shape != (ENTRIES,):
        raise BadRequestError(
            "shape", f"An action has {ENTRIES} numbers (dx dy dz, rx ry rz, grip), got shape {values.shape}."
        )
    if not np.isfinite(values).all():
        raise BadRequestError("not_finite", f"The action holds a number that is not finite: {values.tolist()}.")
    if np.abs(values).max() > 1.0 + 1e-6:
        raise BadRequestError(
            "range", f"The action holds {values[np.abs(values).argmax()]:.3f}; entries must be within [-1, 1]."
        )
    return values


def begin(cell: ArmModel) -> PolicyStream:
    """A stream of actions that starts where the arm is."""
    q = cell.arm.setpoint().goal
    return PolicyStream(cell.chain.tcp_poses(q)[0], q)


def step(cell: ArmModel, stream: PolicyStream, action: Array) -> PolicyStream:
    """The target moved by an action: translation and rotation vector in the arm's base frame.

    Raises `PlanningError` (`unreachable`, `limits`), `MotionError` (`refused`).
    """
    if not action[:6].any():
        return stream
    target = stream.target.copy()
    target[:3, 3] += TRANSLATION * action[:3]
    target[:3, :3] = Rotation.from_rotvec(ROTATION * action[3:6]).as_matrix() @ target[:3, :3]
    return PolicyStream(target, solve(cell, target @ np.linalg.inv(cell.chain.tcp), stream.goal))


def solve(cell: ArmModel, last_joint_frame: Array, seed: Array) -> Array:
    """The configuration (n,) near `seed` that puts the last frame at T_base_last. Raises `PlanningError`, `MotionError`
    (`refused`) where it is on another branch."""
    limits = (cell.chain.low, cell.chain.high)
    q = damped_least_squares(cell.chain, last_joint_frame[None], seed[None], limits, iterations=40)[0]
    if np.isfinite(q).all() and np.abs(q - seed).max() < JUMP:
        return np.asarray(q)
    q = nearest(cell.chain, last_joint_frame, seed, "the action's target")
    if np.abs(q - seed).max() < JUMP:
        return q
    raise MotionError(
        "refused",
        "Motion refused: the action's target can only be reached by folding the arm over.",
        detail={"why": "branch"},
    )


def to_rest(cell: ArmModel, now: Setpoint, goal: Array) -> Trajectory:
    """The jerk-limited motion from a moving set-point to rest at `goal` (n,), all joints arriving together (ruckig)."""
    from ruckig import InputParameter, Result, Ruckig
    from ruckig import Trajectory as Course

    spec, profile, course = cell.spec, InputParameter(cell.spec.dof), Course(cell.spec.dof)
    most = [SHARE * x.acceleration for x in spec.limits]
    profile.current_position, profile.current_velocity = list(now.positions), list(now.velocities)
    profile.current_acceleration = list(np.clip(now.accelerations, np.negative(most), most))
    profile.target_position = list(goal)
    profile.max_velocity = [SPEED * x.velocity for x in spec.limits]
    profile.max_acceleration, profile.max_jerk = most, [SHARE * x.jerk for x in spec.limits]
    profile.minimum_duration = LAG
    if Ruckig(spec.dof).calculate(profile, course) not in (Result.Working, Result.Finished):
        raise MotionError("refused", "Motion refused: no way from here to the action's target.", detail={"why": "rate"})
    if course.duration > MOST_LAG:
        raise MotionError(
            "refused",
            f"Motion refused: the arm would be {course.duration:.2f} s behind the policy, more than {MOST_LAG:g} s.",
            hint="Act in smaller steps, or less often.",
            detail={"why": "rate", "behind_s": round(course.duration, 3)},
        )
    times = np.linspace(0.0, course.duration, max(2, round(course.duration / SAMPLE) + 1))
    rows = [course.at_time(t) for t in times]
    return Trajectory(times, np.array([r[0] for r in rows]), np.array([r[1] for r in rows]))


def wants_closed(action: Array) -> bool | None:
    """True to close, False to open, None to leave the jaws: robosuite's sign, -1 open, 1 closed."""
    return None if action[6] == 0 else bool(action[6] > 0)
