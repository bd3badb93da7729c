"""Measurements of motion on one robot: each gives samples in seconds of processor time of one core."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from gap_catalogue.shared.robot_chain import chain, joint_range
from gap_motion.bench.problems import GraspProblem, PlanningProblem, checker_among
from gap_motion.bench.verify import TrajectoryVerifier
from gap_motion.collision.checker import CollisionChecker
from gap_motion.kinematics.ik import candidates, inside, nearest
from gap_motion.planning.feasibility import assess
from gap_motion.planning.free_motion import TRIES, timed, to_grasps
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.paths import polyline, velocity_limits
from gap_motion.planning.planner import PathSearch, plan, shortcut
from gap_motion.timing.timing import time_path
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array, Trajectory

WITHIN = 1.0  # s: a problem counts as solved when its motion is ready by then


@dataclass
class Timed:
    """Samples [s] by what was measured, motions made, and how many problems there were."""

    samples: dict[str, list[float]] = field(default_factory=dict)
    motions: list[Trajectory | None] = field(default_factory=list)

    @contextmanager
    def of(self, what: str) -> Iterator[None]:
        """Time a block."""
        began = time.process_time()
        try:
            yield
        finally:
            self.samples.setdefault(what, []).append(time.process_time() - began)

    @property
    def solved(self) -> float:
        """Share of the problems whose motion was ready within `WITHIN`."""
        total = self.samples["whole"]
        done = [m is not None and t <= WITHIN for m, t in zip(self.motions, total, strict=True)]
        return float(np.mean(done))


def free_motions(problems: list[PlanningProblem], search: PathSearch | None = None) -> Timed:
    """Plan, simplify and time each problem; a `search` plans and simplifies in one."""
    out = Timed()
    for problem in problems:
        began = time.process_time()
        out.motions.append(_attempts(problem, out, search))
        out.samples.setdefault("whole", []).append(time.process_time() - began)
    return out


def _attempts(problem: PlanningProblem, out: Timed, search: PathSearch | None) -> Trajectory | None:
    checker, start, goals = problem.checker, problem.start, problem.goals
    for attempt, step in enumerate(TRIES):
        try:
            with out.of("plan"):
                rows = plan(checker, start, goals, attempt, step=step, simplify=False, search=search).waypoints
        except PlanningError:
            return None
        if search is None:
            with out.of("simplify"):
                rows = shortcut(MotionValidator(checker, step), rows, attempt)
        with out.of("time and check"):
            found = timed(checker, rows)
        if found is not None:
            return found
    return None


def grasp_motions(problems: list[GraspProblem], search: PathSearch | None = None) -> Timed:
    """A motion to one of each problem's grasps, from the request to the timed trajectory."""
    out = Timed()
    for problem in problems:
        with out.of("whole"):
            try:
                found = to_grasps(problem.scene, problem.start, problem.grasps, 0.08, [problem.target], 0, search)
                out.motions.append(found.trajectory)
            except PlanningError:
                out.motions.append(None)
    return out


def feasibilities(problems: list[GraspProblem]) -> list[float]:
    """Judge all grasps of each problem."""
    out = Timed()
    for problem in problems:
        cell, scene = problem.scene.cell, problem.scene
        with out.of("feasibility"):
            reaching = scene.checker(reaching=True, grasped=[problem.target])
            assess(cell, scene.checker(), reaching, problem.grasps, 0.1, problem.start)
    return out.samples["feasibility"]


def plain_mujoco(problems: list[PlanningProblem], judge_of: Callable[[PlanningProblem], TrajectoryVerifier]) -> Timed:
    """The same planner and shortcuts on a plain MuJoCo checker, one configuration at a time."""
    out = Timed()
    for problem in problems:
        checker = PlainMujocoChecker(problem.checker, judge_of(problem))
        with out.of("whole"):
            try:
                plan(checker, problem.start, problem.goals)
                out.motions.append(Trajectory(np.zeros(1), problem.start[None]))
            except PlanningError:
                out.motions.append(None)
    return out


class PlainMujocoChecker(CollisionChecker):
    """A checker that asks MuJoCo about every configuration."""

    def __init__(self, like: CollisionChecker, judge: TrajectoryVerifier) -> None:
        super().__init__(like.chain, like.base, like.body, like.world, like.margin)
        self._judge = judge

    def valid(self, q: Array) -> Array:
        """One by one."""
        return np.array([self._judge.free(row) for row in q])

    def free(self, q: Array) -> bool:
        """One by one, until one is not."""
        return all(self._judge.free(row) for row in np.atleast_2d(q))

    def probe(self, q: Array) -> Array | None:
        """One by one; where the spheres are is still asked of the layout, which says how close to look."""
        return self._place(q) if self.free(q) else None

    def first_contact(self, q: Array) -> None:
        """Problems start free."""


def single_ik(spec: RobotSpec, count: int) -> list[float]:
    """One pose at a time, from home."""
    arm, home, out = chain(spec), np.array(spec.home), Timed()
    for T in _poses(spec, count):
        with out.of("ik"):
            nearest(arm, T, home)
    return out.samples["ik"]


def batched_ik(spec: RobotSpec, count: int, solver: str) -> tuple[float, float]:
    """Solutions per second for `count` poses in one call, and the share solved; `solver`: closed, or torch."""
    arm, home, T = chain(spec), np.array(spec.home), _poses(spec, count)
    if solver == "torch":
        import torch

        from gap_motion.kinematics.ik_torch import solve_batch

        torch.set_num_threads(1)
        solve_batch(arm, T[:2], home)
        began = time.process_time()
        solved = ~np.isnan(solve_batch(arm, T, home)).any(axis=1)
    else:
        candidates(arm, T[:2], home)
        began = time.process_time()
        solved = inside(arm, candidates(arm, T, home)).any(axis=1)
    return count / (time.process_time() - began), float(solved.mean())


def checks(spec: RobotSpec, problems: list[PlanningProblem], count: int) -> tuple[float, float]:
    """Seconds per configuration, amortised over `count`: bare, and among the problems' obstacles."""
    low, high = joint_range(spec)
    q = np.random.default_rng(0).uniform(low, high, (count, spec.dof))
    bare = checker_among(spec, ())
    bare.valid(q)
    began = time.process_time()
    for _ in range(10):
        bare.valid(q)
    alone = (time.process_time() - began) / (10 * count)
    began = time.process_time()
    for problem in problems:
        problem.checker.valid(q)
    return alone, (time.process_time() - began) / (len(problems) * count)


def retiming(spec: RobotSpec, problems: list[PlanningProblem]) -> list[float]:
    """Time a path of three segments each."""
    arm, out = chain(spec), Timed()
    for problem in problems:
        s = np.linspace(0.0, 1.0, 4)[:, None]
        bow = 0.2 * np.sin(np.pi * s) * np.cos(np.arange(spec.dof))
        path = polyline(problem.start + s * (problem.goals[0] - problem.start) + bow, velocity_limits(spec))
        with out.of("time"):
            time_path(path, arm)
    return out.samples["time"]


def _poses(spec: RobotSpec, count: int) -> Array:
    """Poses of random configurations, of the frame behind the last joint."""
    low, high = joint_range(spec)
    q = np.random.default_rng(1).uniform(low, high, (count, spec.dof))
    return chain(spec).poses(q, np.eye(4))
