"""Draws instances from a task's belief: composer variations per region, rejected until objects fit and are in reach."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Mapping
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from dm_control.composer import variation
from dm_control.composer.variation import distributions
from scipy.spatial.transform import Rotation

from gap_mujoco.model.footprint import clearance, footprint
from gap_runtime.contracts.failures import TaskInfeasibleError, UnknownNameError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.task import Distribution, Placement, Task
from gap_runtime.contracts.types import Array, Quaternion, Se3Pose, Vec3

Draw = dict[str, tuple[Array, float]]  # by object: xy in the world [m], yaw [rad]
EXAMINED = 100  # draws that an infeasible scene is explained with


def as_variation(distribution: Distribution) -> Any:
    """The composer variation (or constant) a distribution of task.yaml stands for."""
    if distribution.uniform is not None:
        low, high = (np.asarray(v, float) for v in distribution.uniform)
        return distributions.Uniform(low, high)
    if distribution.normal is not None:
        mean, spread = (np.asarray(v, float) for v in distribution.normal)
        return distributions.Normal(mean, spread)
    if distribution.choice is not None:
        choices = np.asarray(distribution.choice, float)
        return distributions.UniformChoice(choices) if choices.ndim == 1 else partial(_any_row, choices)
    return np.asarray(distribution.constant, float)


def _any_row(choices: Array, random_state: np.random.RandomState) -> Array:
    return np.asarray(choices[random_state.randint(len(choices))])


class Belief:
    """Samples one scene of a task."""

    def __init__(self, task: Task, scene: str, robots: Mapping[str, RobotSpec]) -> None:
        self._task, self._scene = task, scene
        self._models = task.scene_objects(scene)
        self._regions: dict[str, Placement] = {n: task.belief.regions[r] for n, r in task.scenes[scene].items()}
        self._variations = {
            name: {"offset": as_variation(p.offset), "yaw_deg": as_variation(p.yaw_deg)}
            for name, p in self._regions.items()
        }
        for place in task.robots:
            if place.model not in robots:
                raise UnknownNameError("robot", place.model, robots)
        self._reach = [(np.array(p.position[:2]), robots[p.model].reach) for p in task.robots]

    def sample(self, seed: int) -> Instance:
        """The instance of this seed; always the same. Raises `TaskInfeasibleError` after `belief.attempts` draws."""
        random = self._random(seed)
        for _ in range(self._task.belief.attempts):
            draw = self._draw(random)
            if not self._violations(draw):
                return Instance(seed, self._scene, {name: self._pose(name, *draw[name]) for name in draw}, self._joints)
        raise self._infeasible(seed)

    def region(self, name: str) -> str:
        """The region that the object starts in."""
        return self._task.scenes[self._scene][name]

    def _random(self, seed: int) -> np.random.RandomState:
        """Named scenes draw independently, so that no scene is another one's shadow."""
        entropy = np.random.SeedSequence([seed, zlib.crc32(self._scene.encode())])
        return np.random.RandomState(np.random.MT19937(entropy))

    @property
    def _joints(self) -> dict[str, float]:
        return {name: joint.initial for name, joint in self._task.joints.items()}

    def _draw(self, random: np.random.RandomState) -> Draw:
        drawn = variation.evaluate(self._variations, random_state=random)
        return {
            name: (np.array(self._regions[name].center) + value["offset"], float(np.radians(value["yaw_deg"])))
            for name, value in drawn.items()
        }

    def _violations(self, draw: Draw) -> list[str]:
        """What this draw does not keep to; empty when it can be used."""
        found = []
        prints = {name: footprint(self._models[name].shape, *draw[name]) for name in draw}
        for name, (corners, radius) in prints.items():
            support = self._task.environment.supports[self._regions[name].support]
            beyond = np.abs(corners - support.center) + radius - support.half_size
            if beyond.max() > 0:
                found.append(f"{self._placed(name)} is on its support {self._regions[name].support}")
            if not any(np.linalg.norm(draw[name][0] - base) <= reach for base, reach in self._reach):
                reach = ", ".join(f"{reach:g} m" for _, reach in self._reach)
                found.append(f"{self._placed(name)} is within reach of a robot ({reach} from its base)")
        for a, b in combinations(prints, 2):
            if clearance(prints[a], prints[b]) < self._task.belief.clearance:
                margin = f"by belief.clearance, {self._task.belief.clearance:g} m"
                found.append(f"{self._placed(a)} is clear of {self._placed(b)} {margin},")
        return found

    def _pose(self, name: str, xy: Array, yaw: float) -> Se3Pose:
        z = self._task.environment.supports[self._regions[name].support].z + self._models[name].shape.size[2] / 2
        return Se3Pose(Vec3(float(xy[0]), float(xy[1]), z), Quaternion.of(Rotation.from_euler("z", yaw)))

    def _placed(self, name: str) -> str:
        return f"{name} in region {self.region(name)}"

    def _infeasible(self, seed: int) -> TaskInfeasibleError:
        random, violations = self._random(seed), Counter[str]()
        for _ in range(EXAMINED):
            violations.update(self._violations(self._draw(random)))
        worst = "; ".join(f"{what} in {EXAMINED - n} of {EXAMINED} draws" for what, n in violations.most_common(3))
        return TaskInfeasibleError(
            f"Scene {self._scene!r}: no placement found in {self._task.belief.attempts} draws: {worst}.",
            hint="Move or widen these regions, lower belief.clearance, or raise belief.attempts.",
        )
