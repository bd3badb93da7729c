"""The last look at a command before it reaches an arm: inside everything, or refused whole. Nothing is clamped."""

from __future__ import annotations

from typing import Any

import numpy as np

from gap_motion.arguments import ArmModel
from gap_runtime.contracts.arm import Setpoint
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.types import Array, Trajectory

START = 0.02  # rad between a trajectory's start and the arm
SLACK = 1.02  # of a rate limit: what differences of samples may show beyond the motion they were taken from
RATES = (("velocity", "rad/s"), ("acceleration", "rad/s^2"), ("jerk", "rad/s^3"))


def check_trajectory_limits(
    cell: ArmModel, trajectory: Trajectory, task: Task, now: Array, flying: Setpoint | None = None
) -> None:
    """Raise `MotionError` (`refused`) unless the whole trajectory may run from the joints `now` (n,).

    It must begin at rest, or take over from the `flying` set-point, and end at rest. `detail["why"]` is `not_finite`,
    `start`, `limits`, `rate` or `workspace`; numbers and the joint are beside it.
    """
    times, q = trajectory.times, trajectory.positions
    if not (np.isfinite(times).all() and np.isfinite(q).all()):
        raise _refused("not_finite", "it holds a number that is not finite")
    gap = np.abs(q[0] - now)
    if gap.max() > START:
        joint = cell.spec.joints[int(gap.argmax())]
        raise _refused("start", f"it starts {gap.max():.3f} rad from where {joint} is", joint=joint)
    _limits(cell, q)
    _rates(cell, times, q, flying)
    tcp = cell.tcp(q)[:, :3, 3]
    _tcp_speed(cell, times, tcp)
    outside = _outside(tcp, task)
    if outside.max() > max(1e-3, outside[0] + 1e-3):
        worst = int(outside.argmax())
        raise _refused(
            "workspace",
            f"it takes the TCP {outside[worst]:.3f} m outside the workspace",
            f"The workspace is {task.environment.workspace[0]} to {task.environment.workspace[1]}.",
            time_s=round(float(times[worst]), 3),
        )


def workspace_excess(cell: ArmModel, q: Array, task: Task) -> Array:
    """How far the TCP is outside the task's workspace box at configurations (N, n) [m], 0 inside; shape (N,)."""
    return _outside(cell.tcp(q)[:, :3, 3], task)


def _outside(p: Array, task: Task) -> Array:
    low, high = np.array(task.environment.workspace)
    return np.asarray(np.maximum(np.maximum(low - p, p - high), 0.0).max(axis=1))


def _limits(cell: ArmModel, q: Array) -> None:
    low, high = (np.array([getattr(x, k) for x in cell.spec.limits]) for k in ("lower", "upper"))
    excess = np.maximum(low - q, q - high).max(axis=0)
    if excess.max() > 1e-6:
        worst = int(excess.argmax())
        joint = cell.spec.joints[worst]
        raise _refused("limits", f"{joint} would leave its range by {excess[worst]:.4f} rad", joint=joint)


def _rates(cell: ArmModel, times: Array, q: Array, flying: Setpoint | None) -> None:
    """Divided differences of the samples against each limit, together with what goes before and comes after them.

    So a command that does not begin with the motion the arm is in, or does not end at rest, breaks the jerk's.
    """
    if len(times) < 2:
        return
    at, rows = _with_ends(times, q, flying)
    for name, unit in RATES:
        steps = np.diff(at)
        rows = np.diff(rows, axis=0) / steps[:, None]
        at = (at[1:] + at[:-1]) / 2
        bound = np.array([getattr(x, name) for x in cell.spec.limits])
        ratio = np.abs(rows).max(axis=0) / bound
        if ratio.max() > SLACK:
            worst = int(ratio.argmax())
            joint = cell.spec.joints[worst]
            value = ratio[worst] * bound[worst]
            raise _refused(
                "rate",
                f"{joint} would need {name} {value:.3g} {unit}, its limit is {bound[worst]:g}",
                "Slow it down, or let a planning tool time it.",
                joint=joint,
            )


def _with_ends(times: Array, q: Array, flying: Setpoint | None) -> tuple[Array, Array]:
    """The samples with those before, of the motion the arm is in, and those after, at rest."""
    order = np.arange(1, len(RATES) + 1)
    before, after = -order[::-1] * (times[1] - times[0]), order * (times[-1] - times[-2])
    earlier = np.repeat(q[:1], len(order), axis=0)
    if flying is not None:
        earlier = earlier + before[:, None] * flying.velocities + before[:, None] ** 2 / 2 * flying.accelerations
    later = np.repeat(q[-1:], len(order), axis=0)
    return np.concatenate([times[0] + before, times, times[-1] + after]), np.concatenate([earlier, q, later])


def _tcp_speed(cell: ArmModel, times: Array, p: Array) -> None:
    if len(times) < 2:
        return
    speed = float((np.linalg.norm(np.diff(p, axis=0), axis=1) / np.diff(times)).max())
    if speed > SLACK * cell.spec.tcp_velocity:
        raise _refused(
            "rate",
            f"the TCP would move at {speed:.2f} m/s, its limit is {cell.spec.tcp_velocity:g}",
            "Slow it down, or let a planning tool time it.",
        )


def _refused(why: str, problem: str, hint: str = "", **detail: Any) -> MotionError:
    return MotionError("refused", f"Motion refused: {problem}.", hint=hint, detail={"why": why, **detail})
