"""VAMP as the search of a planning request: its trees and its shortcuts in its own model of the arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gap_catalogue.shared.robot_chain import joint_range
from gap_motion.collision.checker import CollisionChecker
from gap_motion.collision.primitives import PrimitiveScene
from gap_motion.kinematics.robot_model import LinkSpheres
from gap_motion.planning.motion_validator import MotionValidator
from gap_motion.planning.planning_scene import PlanningScene
from gap_motion.vamp.arm import EMBEDDED, VampArm, floats, library, vamp_arm
from gap_motion.vamp.scene import environment
from gap_runtime.contracts.failures import PlanningError
from gap_runtime.contracts.types import Array

ITERATIONS = 50_000  # of RRTConnect, and vertices of its trees
IMPROVING = 2_000  # of AORRTC in all, when the path is to be improved
TRIES = 6  # searches, until a path is free in our model of the arm and inside our joint limits as well
MORE = 0.01  # m: how much farther each keeps away than the one before: VAMP's links are up to 5 cm thinner than ours
OFFSETS = 100_000  # places in VAMP's sequence of samples where a seed may begin


@dataclass(frozen=True)
class VampSearch:
    """RRTConnect (Kuffner and LaValle 2000), or AORRTC (Wilson et al. 2025) to `improve`, and VAMP's shortcuts.

    `held` are the parts of an object in the gripper. A search for an arm that VAMP has no model of raises `ToolError`
    (`unsupported`).
    """

    held: tuple[LinkSpheres, ...] = ()
    improve: bool = False

    @classmethod
    def of(cls, scene: PlanningScene, improve: bool = False) -> VampSearch:
        """For a request's planning scene."""
        return cls(scene.body.parts[scene.held_from :], improve)

    def __call__(self, checker: CollisionChecker, start: Array, goals: Array, seed: int) -> Array:
        """Waypoints (M, n) from start (n,) to one of goals (G, n).

        Raises `PlanningError` (`in_collision`, `no_path`), and as `vamp_arm`.
        """
        arm, edges = vamp_arm(checker.chain), MotionValidator(checker)
        goals = self._standing(arm, start, goals)
        rng = arm.module.halton()
        rng.skip(int(np.random.SeedSequence(seed).generate_state(1)[0]) % OFFSETS)
        for k in range(TRIES):
            world = self._world(arm, checker, [start, *goals], checker.margin + k * MORE)
            found = self._find(arm, start, goals, world, rng)
            if not found.solved:
                break
            rows = _within(checker, arm, found.path, world, rng)
            if rows is None:
                continue
            rows[0] = start
            rows[-1] = goals[np.argmin(np.abs(goals - rows[-1]).max(axis=1))]
            if edges.path_free(rows):
                return rows
        raise PlanningError(
            "no_path",
            f"VAMP found no path of {ITERATIONS} iterations that is free in the embedded model as well.",
            hint="Try another seed, another goal, or fewer obstacles.",
            detail={"iterations": ITERATIONS, "tries": k + 1, "goals": len(goals)},
        )

    def _standing(self, arm: VampArm, start: Array, goals: Array) -> Array:
        """The goals at which the arm does not touch itself in VAMP's model. Raises `PlanningError` (`in_collision`)."""
        alone = library().Environment()
        if not arm.module.validate(floats(start), alone):
            raise _refused(arm, "The start is")
        kept = goals[[bool(arm.module.validate(floats(goal), alone)) for goal in goals]]
        if not len(kept):
            raise _refused(arm, "All goals are")
        return np.asarray(kept)

    def _find(self, arm: VampArm, start: Array, goals: Array, world: Any, rng: Any) -> Any:
        """VAMP's own result: `solved`, and its `path`."""
        vamp = library()
        trees = vamp.RRTCSettings()
        trees.range = vamp.ROBOT_RRT_RANGES.get(arm.name, trees.range)
        trees.max_iterations = trees.max_samples = ITERATIONS
        ends = floats(start), [floats(goal) for goal in goals]
        if self.improve:
            settings = vamp.AORRTCSettings()
            settings.rrtc, settings.max_iterations, settings.max_samples = trees, IMPROVING, ITERATIONS
            better = arm.module.aorrtc(*ends, world, settings, rng)
            if better.solved:
                return better
        return arm.module.rrtc(*ends, world, trees, rng)

    def _world(self, arm: VampArm, checker: CollisionChecker, stands: list[Array], margin: float) -> Any:
        """VAMP's scene, which gives way to its model where the arm may certainly stand."""
        scene = PrimitiveScene.of(checker)
        scene.clear_start_contacts(arm.spheres(stands[0])[arm.fixed], margin, aside=0.0)
        for q in stands:
            scene.clear_start_contacts(arm.spheres(q)[~arm.fixed], margin)
            if self.held:
                scene.clear_start_contacts(self._held_at(checker, q), margin)
        vamp = library()
        out = environment(scene, vamp, margin)
        if self.held:
            out.attach(self._attachment(vamp, arm))
        return out

    def _held_at(self, checker: CollisionChecker, q: Array) -> Array:
        """What is held, at a configuration (n,): rows of centre and radius (S, 4) in the base frame."""
        T = checker.chain.frames(q)[-1, 0]
        rows = [np.column_stack([part.centers @ T[:3, :3].T + T[:3, 3], part.radii]) for part in self.held]
        return np.concatenate(rows)

    def _attachment(self, vamp: Any, arm: VampArm) -> Any:
        to_tip = np.linalg.inv(arm.tip)
        out = vamp.Attachment(np.eye(4, dtype=np.float32))
        for part in self.held:
            centers = part.centers @ to_tip[:3, :3].T + to_tip[:3, 3]
            out.add_spheres([vamp.Sphere(c, r) for c, r in zip(centers.tolist(), part.radii.tolist(), strict=True)])
        return out


def _within(checker: CollisionChecker, arm: VampArm, path: Any, world: Any, rng: Any) -> Array | None:
    """The path moved inside our joint limits, which are narrower, and simplified; None where it is not free then."""
    rows, limits = path.numpy(), joint_range(checker.chain.spec)
    inside = np.clip(rows, *limits)
    if (inside != rows).any():
        path = arm.module.Path()
        for row in inside:
            path.append(floats(row))
        if not path.validate(world):
            return None
    simple = arm.module.simplify(path, world, library().SimplifySettings(), rng).path.numpy()
    return np.asarray(np.clip(np.array(simple, dtype=float), *limits))  # single precision rounds, past a limit too


def _refused(arm: VampArm, what: str) -> PlanningError:
    return PlanningError(
        "in_collision",
        f"{what} in collision with the arm itself in VAMP's model of it, {arm.name}, which is a coarser one.",
        hint=EMBEDDED,
        detail={"model": arm.name, "waypoint": 0},
    )
