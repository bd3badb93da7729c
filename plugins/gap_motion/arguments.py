"""Reads the arguments of motion tools: what is not finite or not well-formed is refused here, before any planning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gap_catalogue.shared.robot_chain import Chain, chain
from gap_runtime.contracts.arm import Arm
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, JointState, Se3Pose, Trajectory, Vec3

STEP = 0.05  # s: one `max_steps` step, the 20 Hz control period of the environments the catalogue comes from
GOING = 0.02  # rad: an arm whose motion ends farther away than this is on its way


def arm_of(ctx: ToolContext, arm_id: int) -> Arm:
    """An arm of the cell. Raises `BadRequestError` (`unknown_arm`)."""
    arms = ctx.cell.arms
    if isinstance(arm_id, bool) or not 0 <= arm_id < len(arms):
        raise BadRequestError("unknown_arm", f"There is no arm {arm_id}.", hint=f"Arms: 0 to {len(arms) - 1}.")
    return arms[arm_id]


def pose_matrix(pose: Se3Pose, what: str) -> Array:
    """Homogeneous matrix (4, 4). Raises `BadRequestError` (`not_finite`); its own type keeps the quaternion unit."""
    if not np.isfinite(pose.position.array).all():
        raise BadRequestError("not_finite", f"{what} has a position that is not finite: {pose.position}.")
    return pose.matrix


def pose_list(poses: Sequence[Se3Pose], what: str, at_most: int) -> Array:
    """Homogeneous matrices (M, 4, 4). Raises `BadRequestError` (`empty`, `too_large`), and as `pose_matrix`."""
    if len(poses) > at_most:
        raise BadRequestError("too_large", f"{what} has {len(poses)} poses; at most {at_most} are taken.")
    if not poses:
        raise BadRequestError("empty", f"{what} is empty; there is nothing to plan to.")
    return np.array([pose_matrix(pose, f"{what}[{i}]") for i, pose in enumerate(poses)])


def joints_of(state: JointState, spec: RobotSpec, what: str) -> Array:
    """Joint positions (n,). Raises `BadRequestError`: `joint_count`, `not_finite`, or `limits` with the joint."""
    q = state.positions
    if q.shape != (spec.dof,):
        raise BadRequestError(
            "joint_count", f"{what} has {len(q)} joints; {spec.name} has {spec.dof}: {', '.join(spec.joints)}."
        )
    if not np.isfinite(q).all():
        raise BadRequestError("not_finite", f"{what} holds a number that is not finite: {q.tolist()}.")
    for value, name, limit in zip(q, spec.joints, spec.limits, strict=True):
        excess = max(limit.lower - value, value - limit.upper)
        if excess > 1e-6:
            raise BadRequestError(
                "limits",
                f"{what} has {name} at {value:.4f} rad, {excess:.4f} rad outside [{limit.lower}, {limit.upper}].",
                detail={"joint": name, "excess_rad": round(float(excess), 5)},
            )
    return q


def trajectory_of(trajectory: Trajectory, spec: RobotSpec, what: str = "trajectory") -> Trajectory:
    """The trajectory itself. Raises `BadRequestError`: `empty`, `joint_count`, `not_finite`, or `times`."""
    if len(trajectory.times) == 0:
        raise BadRequestError("empty", f"The {what} has no points.", hint="Did the planner that made it succeed?")
    if trajectory.positions.shape[1] != spec.dof:
        raise BadRequestError(
            "joint_count", f"The {what} has {trajectory.positions.shape[1]} joints; {spec.name} has {spec.dof}."
        )
    arrays = [a for a in (trajectory.times, trajectory.positions, trajectory.velocities) if a is not None]
    if not all(np.isfinite(a).all() for a in arrays):
        raise BadRequestError("not_finite", f"The {what} holds a number that is not finite.")
    if (np.diff(trajectory.times) <= 0).any():
        raise BadRequestError("times", f"The times of the {what} do not grow.")
    return trajectory


def positive(value: float, what: str) -> float:
    """A finite number above zero. Raises `BadRequestError` (`range`)."""
    if not np.isfinite(value) or value <= 0:
        raise BadRequestError("range", f"{what} must be a positive number, got {value}.")
    return float(value)


def finite(value: float, what: str) -> float:
    """A finite number. Raises `BadRequestError` (`not_finite`)."""
    if not np.isfinite(value):
        raise BadRequestError("not_finite", f"{what} must be a finite number, got {value}.")
    return float(value)


class ArmModel:
    """One arm where it stands: its chain, and how world poses become poses of the frame behind its last joint."""

    def __init__(self, arm: Arm, arm_id: int = 0) -> None:
        self.arm, self.arm_id, self.spec = arm, arm_id, arm.spec
        self.chain: Chain = chain(arm.spec)
        self.base: Array = arm.base_pose.matrix
        self._to_base: Array = np.linalg.inv(self.base)

    @classmethod
    def of(cls, ctx: ToolContext, arm_id: int) -> ArmModel:
        """The cell of one arm. Raises `BadRequestError` (`unknown_arm`)."""
        return cls(arm_of(ctx, arm_id), arm_id)

    def joints(self) -> Array:
        """Where the arm's joints are now, clipped into their limits (a servo may sag past one by a hair)."""
        low, high = (np.array([getattr(x, k) for x in self.spec.limits]) for k in ("lower", "upper"))
        return np.asarray(np.clip(self.arm.state().joints.positions, low, high))

    def wait_until_settled(self) -> Array:
        """The joints (n,) once a motion under way has ended: where to plan from. Raises its `MotionError`."""
        self.arm.finish()
        return self.joints()

    def occupied_configurations(self) -> list[Array]:
        """Where the arm's joints (n,) are now and, when it is on its way, where its motion ends."""
        now, end = self.joints(), self.arm.setpoint().goal
        return [now, end] if np.abs(end - now).max() > GOING else [now]

    def tcp(self, q: Array) -> Array:
        """T_world_tcp at configurations (N, n), shape (N, 4, 4)."""
        return self.chain.tcp_poses(q, self.base)

    def last_joint_frame(self, T_world_tcp: Array, tcp_offset: Vec3 | None = None, link: str = "") -> Array:
        """Poses of the frame behind the last joint in the base frame for TCP poses (..., 4, 4).

        `link` (default: the flange) sits at `tcp_offset` along the TCP's axes; None means the spec's own TCP.
        """
        name = link or self.spec.flange_link
        inner = self.chain.link_offset(name)
        if tcp_offset is None and name == self.spec.flange_link:
            inner = self.chain.tcp
            offset: Any = np.zeros(3)
        else:
            offset = np.zeros(3) if tcp_offset is None else tcp_offset.array
            if not np.isfinite(offset).all():
                raise BadRequestError("not_finite", f"tcp_offset holds a number that is not finite: {offset.tolist()}.")
        shift = np.eye(4)
        shift[:3, 3] = offset
        return np.asarray(self._to_base @ T_world_tcp @ shift @ np.linalg.inv(inner))


def unit_vector(v: Vec3, what: str) -> Array:
    """Its direction, shape (3,). Raises `BadRequestError` when it is not finite or has no length."""
    length = float(np.linalg.norm(v.array))
    if not np.isfinite(length) or length < 1e-9:
        raise BadRequestError("range", f"{what} must be a finite direction, got {v}.")
    return np.asarray(v.array / length)
