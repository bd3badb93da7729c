"""cuRobo 0.7 (Sundaralingam et al., 2023) as the search of a planning request: joint goals, on a GPU, in its own model.

Its motion is a candidate: the planner shortens the path, times it within the RobotSpec's limits and checks it again.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.shared import research_packages as published
from gap_catalogue.shared.robot_chain import Chain, joint_range
from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.primitives import Box, PrimitiveScene
from gap_motion.kinematics.damped_least_squares import halton_seeds
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planner import shortcut
from gap_runtime.contracts.failures import PlanningError, ToolError
from gap_runtime.contracts.types import Array

ROBOT = "GAP_HF_CUROBO_ROBOT"
ROBOTS = {"panda": "franka.yml", "ur5e": "ur5e.yml"}  # of the configurations cuRobo comes with
TITLE, REPOSITORY = "cuRobo", "the repository NVlabs/curobo, at a 0.7 release"
MOST_BOXES = 1000  # room made for obstacles on the GPU
GOALS = 4  # of the cheapest ones that are tried
ATTEMPTS, TIMEOUT_S = 10, 5.0  # for each of them
LOOKED_AT, SAME = 8, 1e-3  # configurations at which the two kinematics are compared, and m they may be apart


@dataclass(frozen=True)
class Planner:
    """cuRobo's generator for one arm, and its parts that requests are made of."""

    generator: Any
    states: Any
    worlds: Any
    requests: Any
    device: Any

    def state(self, q: Array) -> Any:
        """A configuration (n,) as cuRobo takes it."""
        import torch

        rows = torch.as_tensor(np.atleast_2d(q).copy(), dtype=torch.float32, device=self.device)
        return self.states.JointState.from_position(rows)

    def spheres(self, q: Array) -> Array:
        """Its spheres at a configuration (n,): rows of centre and radius (S, 4) in the arm's base frame [m]."""
        (found,) = self.generator.kinematics.get_robot_as_spheres(self.state(q).position)
        return np.array([(*s.pose[:3], s.radius) for s in found], dtype=float).reshape(-1, 4)


def search(checker: CollisionChecker, start: Array, goals: Array, seed: int) -> Array:
    """Waypoints (M, n) from start (n,) to one of goals (G, n), cheapest first; free in the embedded model as well.

    Raises `PlanningError` (`no_path`), `ToolError` (`extra`, `setting`, `unsupported`, `too_large`, `package`).
    """
    planner, edges = _planner(checker.chain), MotionValidator(checker)
    with published.running(TITLE, seed):
        boxes = _boxes(planner, checker, [start, *goals[:GOALS]])
        planner.generator.clear_world_cache()
        planner.generator.update_world(_world(planner, boxes))
    for goal in goals[:GOALS]:
        with published.running(TITLE, seed):
            request = planner.requests.MotionGenPlanConfig(max_attempts=ATTEMPTS, timeout=TIMEOUT_S)
            found = planner.generator.plan_single_js(planner.state(start), planner.state(goal), request)
            rows = _positions(found, checker.chain.dof) if bool(found.success.any()) else None
        if rows is None:
            continue
        inside = np.clip(rows, *joint_range(checker.chain.spec))
        path = np.concatenate([start[None], inside[1:-1], goal[None]])
        if edges.path_free(path):
            return shortcut(edges, path, seed)
    raise PlanningError(
        "no_path",
        f"cuRobo found no path to the {min(len(goals), GOALS)} nearest goals that is free in the embedded model too.",
        hint="Try another goal, fewer obstacles, or --provider 'curobo.*=embedded'.",
        detail={"goals": len(goals), "attempts": ATTEMPTS},
    )


def _positions(found: Any, dof: int) -> Array:
    rows: Array = found.get_interpolated_plan().position.detach().cpu().numpy().astype(float).reshape(-1, dof)
    if len(rows) < 2 or not np.isfinite(rows).all():
        raise ToolError("package", f"{TITLE} sent a path of {len(rows)} points, or one that is not finite.")
    return rows


def _boxes(planner: Planner, checker: CollisionChecker, stands: list[Array]) -> list[tuple[Array, Array, Array]]:
    """Centres (3,), rotations (3, 3) and full sizes (3,) of what is around, in the arm's base frame.

    It gives way where cuRobo's arm `stands`. A sphere is the cube around it: cuRobo's fastest checker knows boxes only.
    """
    around, margin = PrimitiveScene.of(checker), checker.margin
    around.boxes += [Box(row[:3], np.eye(3), np.full(3, row[3])) for row in around.spheres]
    around.spheres = np.zeros((0, 4))
    for q in stands:
        around.clear_start_contacts(planner.spheres(q), margin)
    found = [(b.center, b.turn.T, 2 * (b.half + min(margin, b.most))) for b in around.boxes]
    if len(found) > MOST_BOXES:
        raise ToolError(
            "too_large",
            f"The scene is {len(found)} boxes; room is made for {MOST_BOXES}.",
            hint="Thin the clouds to a coarser voxel grid.",
        )
    return found


def _world(planner: Planner, boxes: list[tuple[Array, Array, Array]]) -> Any:
    cuboids = []
    for k, (center, rotation, size) in enumerate(boxes):
        x, y, z, w = Rotation.from_matrix(rotation).as_quat()
        pose = [*map(float, center), float(w), float(x), float(y), float(z)]
        cuboids.append(planner.worlds.Cuboid(name=f"box_{k}", pose=pose, dims=[float(s) for s in size]))
    return planner.worlds.WorldConfig(cuboid=cuboids)


def _planner(chain: Chain) -> Planner:
    name = os.environ.get(ROBOT, "").strip() or ROBOTS.get(chain.spec.name)
    if not name:
        raise ToolError(
            "setting",
            f"No configuration of {TITLE} is known for {chain.spec.name}.",
            hint=f"Set {ROBOT} to its robot configuration file; known without: {', '.join(ROBOTS)}.",
        )
    made: Planner = published.once(("curobo", name, chain.spec.name), lambda: _load(name, chain))
    return made


def _load(name: str, chain: Chain) -> Planner:
    motions = published.module("curobo.wrap.reacher.motion_gen", TITLE, REPOSITORY)
    worlds = published.module("curobo.geom.types", TITLE, REPOSITORY)
    states = published.module("curobo.types.robot", TITLE, REPOSITORY)
    with published.running(TITLE, 0):
        config = motions.MotionGenConfig.load_from_robot_config(
            name, worlds.WorldConfig(cuboid=[]), collision_cache={"obb": MOST_BOXES}, interpolation_dt=0.02
        )
        generator = motions.MotionGen(config)
        planner = Planner(generator, states, worlds, motions, generator.tensor_args.device)
        same = _moves_alike(planner, chain)
        if same:
            generator.warmup(warmup_js_trajopt=True)
    if not same:
        raise ToolError(
            "unsupported",
            f"{TITLE}'s robot {name} does not move as {chain.spec.name} does.",
            hint=f"Set {ROBOT} to a configuration of this arm, or use --provider 'curobo.*=embedded'.",
        )
    return planner


def _moves_alike(planner: Planner, chain: Chain) -> bool:
    """True when cuRobo's tool stands still behind our last joint in every configuration."""
    q = halton_seeds(*joint_range(chain.spec), LOOKED_AT)
    if planner.generator.get_retract_config().numel() != chain.dof:
        return False
    state = planner.generator.compute_kinematics(planner.state(q))
    T = np.tile(np.eye(4), (len(q), 1, 1))
    w, x, y, z = state.ee_quat_seq.detach().cpu().numpy().astype(float).reshape(-1, 4).T
    T[:, :3, :3] = Rotation.from_quat(np.column_stack([x, y, z, w])).as_matrix()
    T[:, :3, 3] = state.ee_pos_seq.detach().cpu().numpy().astype(float).reshape(-1, 3)
    behind = np.linalg.inv(chain.frames(q)[-1]) @ T
    return bool(np.abs(behind - behind[0]).max() <= SAME)
