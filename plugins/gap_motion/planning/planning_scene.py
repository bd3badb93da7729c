"""What a planning request is about: one arm where it stands, the scene around it, and what may touch what."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from gap_catalogue.curobo import COLLISION_MARGIN
from gap_catalogue.shared.robot_chain import sphere_centers
from gap_motion.arguments import ArmModel
from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.world import CollisionWorld, graspable, make_world, with_spheres
from gap_motion.kinematics.robot_model import RobotCollisionModel, collision_model, with_attached
from gap_runtime.contracts.failures import BadRequestError, PlanningError
from gap_runtime.contracts.robot import CollisionSphere
from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.types import Array, Se3Pose, WorldConfig

ESCAPE = 0.012  # m: contacts no deeper than this at the start are left behind rather than refused
FINGERTIP = 0.008  # m: how close, margin included, the gripper may come to anything while it reaches for a grasp
EDGE = 5e-4  # m the TCP may be outside the workspace; the last look at a command lets twice as much pass
NOTHING_HELD = 1 << 30  # no part has that index
HELD_CELL = 0.012  # m: half the size of the cells a held object is cut into, each inside one sphere


class SceneRequest(Protocol):
    """What the `curobo.*` requests about one arm among obstacles have in common."""

    @property
    def arm_id(self) -> int:
        """Which arm."""

    @property
    def world_config(self) -> WorldConfig | None:
        """What is around it."""

    @property
    def collision_margin(self) -> float:
        """How far it keeps away [m]."""


@dataclass(eq=False)
class PlanningScene:
    """A cell and its scene. Parts of `body` from `held_from` on are an object in the gripper.

    The TCP stays in the `workspace`, two corners (2, 3) in the world [m], or comes back into it.
    """

    cell: ArmModel
    body: RobotCollisionModel
    world: CollisionWorld
    margin: float = COLLISION_MARGIN
    held_from: int = NOTHING_HELD
    workspace: Array | None = None

    @classmethod
    def of(cls, ctx: ToolContext, request: SceneRequest) -> PlanningScene:
        """The arm with its jaws as they are now, among the request's obstacles and the other arms of the cell.

        Those count where they are and where they are going. Obstacles in `ignore_obstacle_names`, where the request has
        it, are left out.
        """
        arm_id, margin = request.arm_id, request.collision_margin
        if not 0.0 <= margin <= 0.1:
            raise BadRequestError("range", f"collision_margin must be 0 to 0.1 m, got {margin}.")
        cell = ArmModel.of(ctx, arm_id)
        world = make_world(request.world_config, getattr(request, "ignore_obstacle_names", None) or ())
        for other, arm in enumerate(ctx.cell.arms):
            for q in ArmModel(arm, other).occupied_configurations() if other != arm_id else ():
                centers = sphere_centers(arm.spec, q, arm.state().gripper.width)
                T = arm.base_pose.matrix
                radii = np.array([s.radius for s in arm.spec.spheres])
                names = [f"arm:{other}:{s.link}" for s in arm.spec.spheres]
                world = with_spheres(world, names, centers @ T[:3, :3].T + T[:3, 3], radii)
        body, workspace = collision_model(cell.chain, cell.arm.state().gripper.width), ctx.task.environment.workspace
        return cls(cell, body, world, margin, workspace=np.array(workspace))

    def graspable(self, config: WorldConfig | None, grasps: Array) -> list[str]:
        """The obstacles of this scene that any of the TCP poses (K, 4, 4) has between the open jaws."""
        width = self.cell.spec.gripper.max_width
        return [name for name in graspable(config, grasps, width) if name in self.world.names]

    def checker(
        self, start: Array | None = None, *, reaching: bool = False, grasped: Collection[str] = ()
    ) -> CollisionChecker:
        """A checker that lets the arm leave its contacts at `start` (n,), and the gripper touch what is `grasped`.

        `reaching` lets the gripper come within `FINGERTIP` of everything. Raises `PlanningError` (`in_collision`) when
        a contact at the start is deeper than `ESCAPE`.
        """
        allowed: dict[tuple[int, int], float] = {}
        for obstacle, name in enumerate(self.world.names):
            for part in self.body.grippers:
                if name in grasped:
                    allowed[part, obstacle] = np.inf
                elif reaching:
                    allowed[part, obstacle] = min(self.margin, FINGERTIP)
        workspace_box = None if self.workspace is None else self._workspace_box(start)
        checker = CollisionChecker(
            self.cell.chain, self.cell.base, self.body, self.world, self.margin, allowed, workspace_box
        )
        return checker if start is None else self._leaving(checker, start)

    def checker_for_held(self, start: Array) -> CollisionChecker:
        """A checker that lets what is held go on touching what it touches at `start` (n,), and nothing else."""
        checker = self.checker_from(start)
        held = frozenset(range(self.held_from, len(self.body.parts)))
        return self._with(checker, checker.penetrations(start, held))

    def checker_from(self, start: Array) -> CollisionChecker:
        """A checker that allows no contact, with a workspace box wide enough for the TCP at `start` (n,)."""
        return replace(self.checker(), workspace_box=None if self.workspace is None else self._workspace_box(start))

    def _workspace_box(self, start: Array | None) -> Array:
        """The workspace, wide enough for the TCP at `start` (n,)."""
        low, high = np.asarray(self.workspace)
        if start is None:
            return np.stack([low - EDGE, high + EDGE])
        tcp = self.cell.tcp(start)[0, :3, 3]
        return np.stack([np.minimum(low, tcp) - EDGE, np.maximum(high, tcp) + EDGE])

    def _leaving(self, checker: CollisionChecker, start: Array) -> CollisionChecker:
        touching = checker.penetrations(start, frozenset(range(len(self.body.parts))))
        if not touching:
            return checker
        held = {(p, o): d for (p, o), d in touching.items() if d <= ESCAPE or p >= self.held_from}
        if len(held) < len(touching):
            pair, depth = max(touching.items(), key=lambda item: item[1] if item[0] not in held else -1.0)
            names = [self.body.parts[pair[0]].link, self.world.names[pair[1]]]
            raise PlanningError(
                "in_collision",
                f"The start is in collision: {names[0]} with {names[1]}, {depth * 1000:.0f} mm deep.",
                hint="Move the arm away from it, or name it among the obstacles to ignore.",
                detail={"pair": names, "depth_m": round(depth, 4), "waypoint": 0},
            )
        return self._with(checker, held)

    def _with(self, checker: CollisionChecker, depths: Mapping[tuple[int, int], float]) -> CollisionChecker:
        """The checker, with contacts allowed a millimetre deeper than given."""
        allowed = dict(checker.allowed)
        for pair, depth in depths.items():
            allowed[pair] = allowed.get(pair, 0.0) + depth + 0.001
        return replace(checker, allowed=allowed)

    def holding(self, config: WorldConfig, name: str, q: Array) -> PlanningScene:
        """The same, with the named obstacle held by the gripper as it is at configuration `q` (n,).

        Where the object touches the scene now (the table it stands on), it may go on touching it as deep as it does.
        Raises `BadRequestError` (`unknown_obstacle`).
        """
        world = make_world(config, [name])
        world = with_spheres(world, *self._extra(config))
        box = next(o.box for o in config.obstacles if o.name == name)
        frame = self.cell.base @ self.cell.chain.poses(q, np.eye(4))[0]
        spheres = cover_held(box.extent.array, np.linalg.inv(frame) @ Se3Pose(box.center, box.orientation).matrix)
        body = with_attached(self.body, name, spheres, self.cell.chain.dof - 1)
        return replace(self, body=body, world=world, held_from=len(self.body.parts))

    def _extra(self, config: WorldConfig) -> tuple[list[str], Array, Array]:
        """The obstacles of this scene that are not the config's: other arms."""
        known = {o.name for o in config.obstacles}
        rows = [i for i, n in enumerate(self.world.names) if n not in known]
        return [self.world.names[i] for i in rows], self.world.centers[rows], self.world.rounding[rows]


def cover_held(half: Array, T_frame_box: Array) -> Sequence[CollisionSphere]:
    """Spheres that contain a held box of half-extents `half` (3,), in the frame behind the last joint."""
    counts = np.clip(np.ceil(half / HELD_CELL), 1, 8).astype(int)
    cell = half / counts
    axes = [np.linspace(-h + c, h - c, n) for h, c, n in zip(half, cell, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    centers = grid @ T_frame_box[:3, :3].T + T_frame_box[:3, 3]
    radius = float(np.linalg.norm(cell))
    return [CollisionSphere("held", (float(x), float(y), float(z)), radius) for x, y, z in centers]
