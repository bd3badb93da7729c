"""Several arms moving as one: the same clock for all, and never into each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gap_motion.arguments import ArmModel
from gap_motion.collision.sphere_batch import sphere_batch
from gap_motion.kinematics.robot_model import collision_model
from gap_motion.timing.limits import check_trajectory_limits
from gap_motion.timing.timing import PERIOD
from gap_runtime.contracts.cell import LockstepCell
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, Trajectory

APART = 0.01  # m kept between two arms
NEARER = 1e-3  # m: how much nearer one arm may come to another that it is too near to already


def in_step(trajectories: Sequence[Trajectory]) -> list[Trajectory]:
    """The same motions, the shorter ones slowed down so that all take equally long, sampled at equal times.

    Where none moves they are returned as they are, one point each.
    """
    from scipy.interpolate import CubicHermiteSpline

    longest = max(t.duration for t in trajectories)
    if longest == 0.0:
        return list(trajectories)
    times = np.linspace(0.0, longest, max(2, round(longest / PERIOD) + 1))
    out = []
    for t in trajectories:
        if t.duration == 0.0 or t.velocities is None:
            still = np.repeat(t.positions[-1:], len(times), axis=0)
            out.append(Trajectory(times, still, np.zeros_like(still)))
            continue
        slower = t.duration / longest
        curve = CubicHermiteSpline(t.times / slower, t.positions, t.velocities * slower)
        out.append(Trajectory(times, curve(times), curve(times, 1)))
    return out


def move_together(ctx: ToolContext, cells: Sequence[ArmModel], planned: Sequence[Trajectory], tolerance: float) -> None:
    """Let every cell's arm follow its trajectory at the same time.

    Raises `MotionError`: `refused` when one breaks its limits, or two arms would come within `APART`; `unsupported`
    when the world cannot move arms together.
    """
    world = ctx.cell
    if not isinstance(world, LockstepCell):
        raise MotionError(
            "unsupported", "This world cannot move several arms at once.", hint="Move one after the other."
        )
    motions = in_step(planned)
    for cell, motion in zip(cells, motions, strict=True):
        check_trajectory_limits(cell, motion, ctx.task, cell.joints())
    refuse_meeting(cells, motions)
    ctx.raise_if_cancelled()
    if motions[0].duration > 0:
        world.execute({cell.arm_id: motion for cell, motion in zip(cells, motions, strict=True)}, tolerance=tolerance)


def refuse_meeting(cells: Sequence[ArmModel], motions: Sequence[Trajectory]) -> None:
    """Raise `MotionError` (`refused`, why `arms_meet`) when two arms come too near, with links and time."""
    for i, (a, motion_a) in enumerate(zip(cells, motions, strict=True)):
        for b, motion_b in zip(cells[:i], motions[:i], strict=True):
            gaps, names = _gaps(a, motion_a.positions, b, motion_b.positions)
            if gaps.min() < APART:
                at = int(gaps.argmin())
                raise _meeting(b, a, float(gaps[at]), names[at][::-1], float(motion_a.times[at]))


def refuse_meeting_others(ctx: ToolContext, cell: ArmModel, motion: Trajectory) -> None:
    """Raise `MotionError` (`refused`, why `arms_meet`) when one arm's motion comes too near another arm of the cell.

    The others count where they are and where they are going. An arm that is too near already may go away from it.
    """
    for arm_id, arm in enumerate(ctx.cell.arms):
        if arm_id == cell.arm_id:
            continue
        other = ArmModel(arm, arm_id)
        for q in other.occupied_configurations():
            (pa, ra, na), (pb, rb, nb) = _spheres(cell, motion.positions), _spheres(other, q[None])
            gap = np.linalg.norm(pa[:, :, :, None] - pb[:, :, None], axis=1) - ra[:, None] - rb
            room = gap - np.minimum(APART, gap[0] - NEARER)
            if room.min() < 0:
                k, i, j = (int(v) for v in np.unravel_index(int(room.argmin()), room.shape))
                raise _meeting(other, cell, float(gap[k, i, j]), (nb[j], na[i]), float(motion.times[k]))


def _meeting(a: ArmModel, b: ArmModel, gap: float, links: tuple[str, str], time: float) -> MotionError:
    return MotionError(
        "refused",
        f"Motion refused: arms {a.arm_id} and {b.arm_id} would come within {gap * 1000:.0f} mm of each other "
        f"({links[0]}, {links[1]}) after {time:.2f} s.",
        detail={"why": "arms_meet", "pair": list(links), "time_s": round(time, 3)},
    )


def _gaps(a: ArmModel, qa: Array, b: ArmModel, qb: Array) -> tuple[Array, list[tuple[str, str]]]:
    """The smallest distance between two arms at each of N instants, (N,), and the links it is between."""
    (pa, ra, na), (pb, rb, nb) = _spheres(a, qa), _spheres(b, qb)
    gaps, names = np.empty(len(qa)), []
    for k in range(len(qa)):
        gap = np.linalg.norm(pa[k][:, :, None] - pb[k][:, None, :], axis=0) - ra[:, None] - rb
        i, j = np.unravel_index(int(gap.argmin()), gap.shape)
        gaps[k] = gap[i, j]
        names.append((na[i], nb[j]))
    return gaps, names


def _spheres(cell: ArmModel, q: Array) -> tuple[Array, Array, list[str]]:
    body = collision_model(cell.chain, cell.arm.state().gripper.width)
    plan = sphere_batch(body)
    columns = np.concatenate(plan.spheres)
    radii = np.concatenate([part.radii for part in body.parts])
    names = [part.link for part in body.parts for _ in part.radii]
    return plan.place(cell.chain, q, cell.base.astype(np.float32))[:, :, columns], radii, names
