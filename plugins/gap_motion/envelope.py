"""The last look at a command before it reaches an arm: inside everything, or refused whole. Nothing is clamped."""

from __future__ import annotations

from typing import Any

import numpy as np

from gap_cli.contracts.failures import MotionError
from gap_cli.contracts.task import Task
from gap_cli.contracts.types import Array, Trajectory
from gap_motion.requests import Cell

START = 0.02  # rad between a trajectory's start and the arm
SLACK = 1.02  # of a rate limit: what differences of samples may show beyond the motion they were taken from
RATES = (("velocity", "rad/s"), ("acceleration", "rad/s^2"), ("jerk", "rad/s^3"))


def refuse(cell: Cell, trajectory: Trajectory, task: Task, now: Array) -> None:
    """Raise `MotionError` (`refused`) unless the whole trajectory may run from the joints `now` (n,).

    `detail["why"]` is `not_finite`, `start`, `limits`, `rate` or `workspace`; numbers and the joint are beside it.
    """
    times, q = trajectory.times, trajectory.positions
    if not (np.isfinite(times).all() and np.isfinite(q).all()):
        raise _refused("not_finite", "it holds a number that is not finite")
    gap = np.abs(q[0] - now)
    if gap.max() > START:
        joint = cell.spec.joints[int(gap.argmax())]
        raise _refused("start", f"it starts {gap.max():.3f} rad from where {joint} is", joint=joint)
    _limits(cell, q)
    _rates(cell, times, q)
    outside = workspace_excess(cell, q, task)
    if outside.max() > max(1e-3, outside[0] + 1e-3):
        worst = int(outside.argmax())
        raise _refused(
            "workspace",
            f"it takes the TCP {outside[worst]:.3f} m outside the workspace",
            f"The workspace is {task.environment.workspace[0]} to {task.environment.workspace[1]}.",
            time_s=round(float(times[worst]), 3),
        )


def workspace_excess(cell: Cell, q: Array, task: Task) -> Array:
    """How far the TCP is outside the task's workspace box at configurations (N, n) [m], 0 inside; shape (N,)."""
    low, high = np.array(task.environment.workspace)
    p = cell.tcp(q)[:, :3, 3]
    return np.asarray(np.maximum(np.maximum(low - p, p - high), 0.0).max(axis=1))


def _limits(cell: Cell, q: Array) -> None:
    low, high = (np.array([getattr(x, k) for x in cell.spec.limits]) for k in ("lower", "upper"))
    excess = np.maximum(low - q, q - high).max(axis=0)
    if excess.max() > 1e-6:
        worst = int(excess.argmax())
        joint = cell.spec.joints[worst]
        raise _refused("limits", f"{joint} would leave its range by {excess[worst]:.4f} rad", joint=joint)


def _rates(cell: Cell, times: Array, q: Array) -> None:
    """Divided differences of the samples against each limit; a command that starts or ends moving breaks the jerk's."""
    at, rows = times, q
    for name, unit in RATES:
        if len(at) < 2:
            return
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


def _refused(why: str, problem: str, hint: str = "", **detail: Any) -> MotionError:
    return MotionError("refused", f"Motion refused: {problem}.", hint=hint, detail={"why": why, **detail})
