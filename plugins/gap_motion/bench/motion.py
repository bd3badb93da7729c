"""`gap bench motion`: planning, inverse kinematics, checking and timing, independently verified."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from gap_catalogue.shared.robot_chain import chain
from gap_motion.bench import measure
from gap_motion.bench.goals import goals
from gap_motion.bench.problems import GraspProblem, PlanningProblem, free_space, groceries
from gap_motion.bench.verify import TrackingReport, TrajectoryReport, TrajectoryVerifier
from gap_motion.planning.free_motion import PlannedMotion, to_grasps, to_joints
from gap_motion.vamp.arm import DISTRIBUTION, installed, vamp_arm
from gap_motion.vamp.search import VampSearch
from gap_runtime.contracts.bench import BenchContext, BenchReport, Progress
from gap_runtime.contracts.failures import PlanningError, ToolError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Trajectory

ROBOTS = ("panda", "ur5e")  # one of each kind of arm
PROBLEMS, JUDGED, EXECUTED = 100, 10, 2  # problems of each kind; motions judged and executed per problem
JUDGED_FROM = 1000  # the seed of the first motion that is judged, after that of the problems
COLUMNS = ("robot", "what", "n", "median", "p95", "result")
PACKAGES = ("mujoco", "ompl", "numpy", "scipy", "pytorch_kinematics", DISTRIBUTION)
Row = tuple[Any, ...]


def motion(bench: BenchContext) -> BenchReport:
    """Measure one of each kind of arm."""
    rows = [row for found in bench.map(measure_robot, ROBOTS) for row in found]
    vamp = "" if installed() else f" It is not installed here, and its rows are missing: pip install {DISTRIBUTION}."
    return BenchReport("Motion", COLUMNS, tuple(rows), (*NOTES, VAMP_NOTE + vamp), PACKAGES, more=(goals(rows),))


def measure_robot(bench: BenchContext, name: str) -> list[Row]:
    """All rows of one robot."""
    spec, count, seed = bench.robot(name), bench.n or PROBLEMS, bench.seed or 0
    rows = planning(spec, count, seed, bench.progress)
    rows += kinematics(spec, count, seed, bench.progress)
    return rows + verdicts(spec, JUDGED * count, EXECUTED * count, seed + JUDGED_FROM, bench.progress)


NOTES = (
    "Times are processor time of one core, in milliseconds unless said otherwise; nothing is kept between problems.",
    "Free-space problems: boxes on a floor and two configurations, all random, and the cage of spheres. Grasp "
    "problems: six groceries and a basket, 50 top-down grasps of one of them.",
    "solved: share of the problems whose timed, rechecked motion was ready within 1 s.",
    "plain MuJoCo: the same OMPL planner and shortcuts, asking MuJoCo about one configuration at a time.",
    "judged: MuJoCo's collision detection every 4 ms and finite differences, sharing no code with the planner; shares "
    "are the largest part of each limit that any motion uses.",
)
VAMP_NOTE = (
    "VAMP: the same problems, searched and simplified in VAMP's own model of the arm; its times hold the scene's way "
    "into that model and the check of the path in ours, its solved share is that of motions that passed our check."
)


def planning(spec: RobotSpec, count: int, seed: int, progress: Progress) -> list[Row]:
    """Free-space and grasp problems."""
    progress(0.0, "free-space problems")
    free = free_space(spec, count, seed)
    ours = measure.free_motions(free)
    rows = [_times(spec, f"free space: {what}", samples) for what, samples in ours.samples.items()]
    rows.append((spec.name, "free space: solved", count, "", "", f"{ours.solved:.3f}"))
    progress(0.15, "the same on a plain MuJoCo checker")
    plain = measure.plain_mujoco(free, lambda p: TrajectoryVerifier(spec, p.shapes))
    rows.append(_times(spec, "free space: plan and simplify, plain MuJoCo", plain.samples["whole"]))
    progress(0.3, "grasp problems")
    grasps = groceries(spec, count, seed=seed)
    found = measure.grasp_motions(grasps)
    rows.append(_times(spec, "grasps: from request to timed motion", found.samples["whole"]))
    rows.append((spec.name, "grasps: solved", count, "", "", f"{found.solved:.3f}"))
    if installed():
        progress(0.4, "the same with VAMP")
        rows += with_vamp(spec, free, grasps)
    rows.append(_times(spec, "feasibility of 50 grasps", measure.feasibilities(grasps)))
    rows.append(_times(spec, "retiming", measure.retiming(spec, free)))
    return rows


def with_vamp(spec: RobotSpec, free: list[PlanningProblem], grasps: list[GraspProblem]) -> list[Row]:
    """The problems searched by VAMP, or one row that says that it has no model of the arm."""
    try:
        vamp_arm(chain(spec))
    except ToolError as error:
        return [(spec.name, "free space and grasps, VAMP", 0, "", "", error.code)]
    search = VampSearch()
    ours, found = measure.free_motions(free, search), measure.grasp_motions(grasps, search)
    return [
        _times(spec, "free space: plan and simplify, VAMP", ours.samples["plan"]),
        (spec.name, "free space: solved, VAMP", len(free), "", "", f"{ours.solved:.3f}"),
        _times(spec, "grasps: from request to timed motion, VAMP", found.samples["whole"]),
        (spec.name, "grasps: solved, VAMP", len(grasps), "", "", f"{found.solved:.3f}"),
    ]


def kinematics(spec: RobotSpec, count: int, seed: int, progress: Progress) -> list[Row]:
    """Inverse kinematics and collision checks."""
    progress(0.45, "inverse kinematics")
    rows = [_times(spec, "IK, one pose", measure.single_ik(spec, 300))]
    for name, solver in (("closed form", "closed"), ("pytorch-kinematics", "torch")):
        rate, solved = measure.batched_ik(spec, 200, solver)
        rows.append((spec.name, f"IK, 200 poses at once, {name}", 200, "", "", f"{rate:.0f}/s, {solved:.3f} solved"))
    progress(0.5, "collision checks")
    bare, among = measure.checks(spec, free_space(spec, min(count, 20), seed), 1000)
    rows.append((spec.name, "collision check, bare", 1000, "", "", f"{bare * 1e6:.1f} us a configuration"))
    rows.append((spec.name, "collision check, 9 obstacles", 1000, "", "", f"{among * 1e6:.1f} us a configuration"))
    return rows


def verdicts(spec: RobotSpec, judged: int, executed: int, seed: int, progress: Progress) -> list[Row]:
    """What the independent verifier finds in planned and in executed motions."""
    found: list[TrajectoryReport] = []
    tracked: list[TrackingReport] = []
    unsolved = 0
    for k, (judge, made) in enumerate(_motions(spec, judged, seed)):
        progress(0.5 + 0.5 * k / judged, f"judging motion {k + 1} of {judged}")
        if made is None:
            unsolved += 1
            continue
        found.append(judge.judge(made))
        if len(tracked) < executed:
            tracked.append(judge.follow(made))
    contacts = sum(bool(v.contacts) for v in found)
    beyond = sum(not v.clean for v in found)
    shares = {n: max(getattr(v, n) for v in found) for n in ("velocity", "acceleration", "jerk", "tcp_speed")}
    lag, speed, torque, rest = (
        max(getattr(t, n) for t in tracked) for n in ("lag", "velocity", "torque", "rest_error")
    )
    touched = sum(bool(t.contacts) for t in tracked)
    step = max(v.step for v in found)
    return [
        (spec.name, "planned: in collision", len(found), "", "", contacts),
        (spec.name, "planned: beyond a limit or in collision", len(found), "", "", beyond),
        (spec.name, "planned: no motion found", judged, "", "", unsolved),
        (spec.name, "planned: largest share of each limit", len(found), "", "", _shares(shares)),
        (spec.name, "planned: largest joint step between samples", len(found), "", "", f"{step:.3f} rad"),
        (spec.name, "executed: in collision", len(tracked), "", "", touched),
        (spec.name, "executed: largest lag, error at rest", len(tracked), "", "", f"{lag:.4f} rad, {rest:.5f} rad"),
        (spec.name, "executed: largest share of velocity, torque", len(tracked), "", "", f"{speed:.3f}, {torque:.3f}"),
    ]  # fmt: skip


def _motions(spec: RobotSpec, count: int, seed: int) -> Iterator[tuple[TrajectoryVerifier, Trajectory | None]]:
    """The judge and the motion of `count` problems, four of five in free space, on seeds of their own."""
    for k in range(count):
        if k % 5 < 4:
            problem = free_space(spec, 2, seed=seed + k)[1]
            solve = partial(to_joints, problem.checker, problem.start, problem.goals, 0)
            yield TrajectoryVerifier(spec, problem.shapes), _or_none(solve)
        else:
            grasp = groceries(spec, 1, grasps=5, seed=seed + k)[0]
            rest = [s for i, s in enumerate(grasp.shapes) if f"shape_{i}" != grasp.target]
            solve = partial(to_grasps, grasp.scene, grasp.start, grasp.grasps, 0.08, [grasp.target], 0)
            yield TrajectoryVerifier(spec, rest), _or_none(solve)


def _or_none(solve: Callable[[], PlannedMotion]) -> Trajectory | None:
    try:
        return solve().trajectory
    except PlanningError:
        return None


def _times(spec: RobotSpec, what: str, samples: list[float]) -> Row:
    median, late = np.quantile(samples, [0.5, 0.95]) * 1e3
    return (spec.name, what, len(samples), f"{median:.2f}", f"{late:.2f}", "")


def _shares(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in values.items())
