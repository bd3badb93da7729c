"""Problems that planners are measured on: cluttered free space, the sphere cage, and groceries beside a basket."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.shared.robot_chain import chain, joint_range
from gap_motion.arguments import ArmModel
from gap_motion.bench.verify import ObstacleShape
from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.world import CollisionWorld
from gap_motion.kinematics.ik import into_range
from gap_motion.kinematics.robot_model import collision_model
from gap_motion.planning.goals import within_limits
from gap_motion.planning.planning_scene import PlanningScene
from gap_runtime.contracts.arm import Arm, Setpoint
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import (
    ArmState,
    Array,
    GripperState,
    JointState,
    Quaternion,
    Se3Pose,
    Vec3,
)

BOXES = 8
# The well-known cage: spheres of 0.2 m around an arm, which must come from one side of it to the other.
CAGE = (
    (0.55, 0, 0.25), (0.35, 0.35, 0.25), (0, 0.55, 0.25), (-0.55, 0, 0.25), (-0.35, -0.35, 0.25), (0, -0.55, 0.25),
    (0.35, -0.35, 0.25), (0.35, 0.35, 0.8), (0, 0.55, 0.8), (-0.35, 0.35, 0.8), (-0.55, 0, 0.8), (-0.35, -0.35, 0.8),
    (0, -0.55, 0.8), (0.35, -0.35, 0.8),
)  # fmt: skip
CAGE_RADIUS = 0.2
# A thick floor: MuJoCo finds no contact where a capsule passes right through a thin box.
FLOOR = ObstacleShape((0.0, 0.0, -0.51), (1.2, 1.2, 0.5))
GROCERY_HALF = ((0.015, 0.03), (0.015, 0.03), (0.02, 0.07))  # m: ranges of half-extents


@dataclass(frozen=True)
class StaticArm:
    """An arm that stands where it is told and never moves: what planning needs of an arm, and no more."""

    spec: RobotSpec
    joints: tuple[float, ...]

    @property
    def base_pose(self) -> Se3Pose:
        """At the world's origin."""
        return Se3Pose(Vec3(0.0, 0.0, 0.0), Quaternion(1.0, 0.0, 0.0, 0.0))

    def state(self) -> ArmState:
        """At its joints, jaws open."""
        tcp = Se3Pose.of(chain(self.spec).tcp_poses(np.array(self.joints))[0])
        jaws = GripperState(self.spec.gripper.max_width, 1.0)
        return ArmState(0, JointState(np.array(self.joints)), jaws, tcp)

    def setpoint(self) -> Setpoint:
        """At its joints."""
        still = np.zeros(self.spec.dof)
        return Setpoint(np.array(self.joints), still, still, np.array(self.joints))


@dataclass(frozen=True, eq=False)
class PlanningProblem:
    """One arm among shapes, from `start` (n,) to one of `goals` (G, n)."""

    checker: CollisionChecker
    shapes: tuple[ObstacleShape, ...]
    start: Array
    goals: Array


@dataclass(frozen=True, eq=False)
class GraspProblem:
    """One arm among shapes at home, and grasps of one of them: poses (G, 4, 4) of the frame behind the last joint."""

    scene: PlanningScene
    shapes: tuple[ObstacleShape, ...]
    start: Array
    grasps: Array
    target: str


def world_of(shapes: Sequence[ObstacleShape]) -> CollisionWorld:
    """The shapes as a planner's scene, named `shape_0`, ..."""
    n = len(shapes)
    return CollisionWorld(
        tuple(f"shape_{i}" for i in range(n)), np.array([s.center for s in shapes], dtype=float).reshape(-1, 3),
        np.array([s.half for s in shapes], dtype=float).reshape(-1, 3), np.tile(np.eye(3), (n, 1, 1)),
        np.array([s.radius for s in shapes], dtype=float), {},
    )  # fmt: skip


def checker_among(spec: RobotSpec, shapes: Sequence[ObstacleShape]) -> CollisionChecker:
    """The arm at the origin, jaws open, among shapes."""
    arm = chain(spec)
    return CollisionChecker(arm, np.eye(4), collision_model(arm, spec.gripper.max_width), world_of(shapes))


def free_space(spec: RobotSpec, count: int, seed: int = 0) -> list[PlanningProblem]:
    """`count` problems: the cage first, where the arm fits in, then random boxes and random free configurations."""
    rng = np.random.default_rng(seed)
    out = [p for p in [cage(spec, rng)] if p is not None]
    while len(out) < count:
        shapes = (FLOOR, *(_box(rng) for _ in range(BOXES)))
        found = _free_pair(checker_among(spec, shapes), shapes, rng, 60)
        out += [found] if found is not None else []
    return out


def cage(spec: RobotSpec, rng: np.random.Generator) -> PlanningProblem | None:
    """The sphere cage: for the arm it was made for, its own start and goal, else two random free configurations."""
    shapes = tuple(ObstacleShape(center, radius=CAGE_RADIUS) for center in CAGE)
    checker = checker_among(spec, shapes)
    if spec.dof == 7:
        ends = np.array([[0, -0.785, 0, -2.356, 0, 1.571, 0.785], [2.35, 1.0, 0, -0.8, 0, 2.5, 0.785]])
        if checker.valid(ends).all():
            return PlanningProblem(checker, shapes, ends[0], ends[1:])
    return _free_pair(checker, shapes, rng, 400)


def groceries(spec: RobotSpec, count: int, grasps: int = 50, seed: int = 0) -> list[GraspProblem]:
    """`count` problems: six groceries and a basket's walls on the floor, `grasps` top-down grasps of one of them."""
    rng = np.random.default_rng(seed)
    out: list[GraspProblem] = []
    while len(out) < count:
        shapes = _table(rng)
        cell = ArmModel(cast(Arm, StaticArm(spec, spec.home)))
        scene = PlanningScene(cell, collision_model(cell.chain, spec.gripper.max_width), world_of(shapes))
        poses = np.stack([_grasp(shapes[-1], rng) for _ in range(grasps)])
        targets = cell.last_joint_frame(poses)
        home = np.array(spec.home)
        if any(len(q) for q in within_limits(cell.chain, targets[:4], home)):
            out.append(GraspProblem(scene, shapes, home, targets, f"shape_{len(shapes) - 1}"))
    return out


def _box(rng: np.random.Generator) -> ObstacleShape:
    half = rng.uniform(0.04, 0.12, 3)
    radius, angle = rng.uniform(0.4, 0.8), rng.uniform(-np.pi, np.pi)
    x, y, z = radius * np.cos(angle), radius * np.sin(angle), rng.uniform(half[2], 0.8)
    return ObstacleShape((float(x), float(y), float(z)), (float(half[0]), float(half[1]), float(half[2])))


def _free_pair(
    checker: CollisionChecker, shapes: tuple[ObstacleShape, ...], rng: np.random.Generator, tries: int
) -> PlanningProblem | None:
    low, high = (np.clip(side, -np.pi, np.pi) for side in joint_range(checker.chain.spec))
    q = rng.uniform(low, high, (tries, len(low)))
    q = q[checker.valid(q)]
    # a joint that turns more than once reaches a pose in several ways: the goal is the one nearest to the start
    return PlanningProblem(checker, shapes, q[0], into_range(checker.chain, q[1:2], q[0])) if len(q) > 1 else None


def _table(rng: np.random.Generator) -> tuple[ObstacleShape, ...]:
    """Floor, four walls and the bottom of a basket, and six groceries that do not touch; the last one is the target."""
    bx, by, wall, deep = 0.55, 0.27, 0.006, 0.08
    walls = [ObstacleShape((bx + s * 0.085, by, deep), (wall, 0.085, deep)) for s in (-1, 1)]
    walls += [ObstacleShape((bx, by + s * 0.085, deep), (0.085, wall, deep)) for s in (-1, 1)]
    shapes = [
        ObstacleShape((0.0, 0.0, -0.5), (1.2, 1.2, 0.5)),
        *walls,
        ObstacleShape((bx, by, 0.01), (0.085, 0.085, 0.01)),
    ]
    spots: list[Array] = []
    while len(spots) < 6:
        spot = rng.uniform([0.35, -0.3], [0.65, 0.1])
        if all(np.linalg.norm(spot - other) > 0.12 for other in spots):
            spots.append(spot)
    for x, y in spots:
        half = tuple(float(rng.uniform(*r)) for r in GROCERY_HALF)
        shapes.append(ObstacleShape((float(x), float(y), half[2] + 0.001), (half[0], half[1], half[2])))
    return tuple(shapes)


def _grasp(target: ObstacleShape, rng: np.random.Generator) -> Array:
    """A top-down TCP pose at the target, near its top, of random yaw."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xz", [np.pi, 0.0]).as_matrix()
    T[:3, :3] = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)).as_matrix() @ T[:3, :3]
    top = target.center[2] + target.half[2]
    T[:3, 3] = [target.center[0], target.center[1], max(top - 0.03, target.center[2], 0.015)]
    return T
