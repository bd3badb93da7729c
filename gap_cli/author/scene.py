"""Where a scene's objects can stand: which of them is leftmost or next to another in every instance of the task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.author.things import Thing
from gap_runtime.contracts.task import Distribution, Task
from gap_runtime.contracts.types import Array

SIGMAS = 3.0  # of a normal distribution, beyond which an object is not expected
SIZES: dict[str, tuple[Callable[[Any], float], int]] = {
    "largest": (np.prod, 1), "smallest": (np.prod, -1), "tallest": (lambda size: size[2], 1),
    "shortest": (lambda size: size[2], -1),
}  # fmt: skip


class Scene:
    """One scene of a task. Left and right are those of the first camera's picture, or without one the robot's own."""

    def __init__(self, task: Task, name: str) -> None:
        self.task, self.name = task, name
        self.members = task.scenes[name]
        if task.cameras:
            w, x, y, z = next(iter(task.cameras.values())).quaternion
            turn = Rotation.from_quat([x, y, z, w])
            self.right, self.away = turn.apply([1.0, 0, 0])[:2], turn.apply([0, 0, -1.0])[:2]
        else:
            turn = Rotation.from_euler("z", task.robots[0].yaw_deg, degrees=True)
            self.right, self.away = turn.apply([0, -1.0, 0])[:2], turn.apply([1.0, 0, 0])[:2]

    def has(self, thing: Thing) -> bool:
        """Whether the thing is there; joints and supports always are."""
        return thing.kind != "object" or thing.id in self.members

    def support(self, thing: str) -> str:
        """What an object stands on; '' where it is not in the scene."""
        region = self.members.get(thing)
        return self.task.belief.regions[region].support if region else ""

    def at(self, place: str, things: Sequence[Thing]) -> Thing | None:
        """The one that is leftmost, largest, ... among them in every instance; None where that is not certain."""
        if place in SIZES:
            key, sign = SIZES[place]
            sizes = {t.id: sign * float(key(self.task.objects[t.id].shape.size)) for t in things}
            return _only(things, lambda a, b: sizes[a.id] > sizes[b.id])
        along = {"leftmost": -self.right, "rightmost": self.right, "frontmost": -self.away, "backmost": self.away}[
            place
        ]
        return _only(things, lambda a, b: self._before(b, a, along))

    def related(self, relation: str, things: Sequence[Thing], other: Thing) -> list[Thing]:
        """Those that stand in the relation to the other in every instance."""
        if relation == "next_to":
            nearest = _only(things, lambda a, b: self._distance(a, other)[1] < self._distance(b, other)[0])
            return [nearest] if nearest else []
        along = {"left_of": -self.right, "right_of": self.right, "in_front_of": -self.away, "behind": self.away}[
            relation
        ]
        return [t for t in things if self._before(other, t, along)]

    def _before(self, a: Thing, b: Thing, along: Array) -> bool:
        """True when b is surely farther along a direction than a."""
        return bool((self._area(a) @ along).max() < (self._area(b) @ along).min())

    def _distance(self, a: Thing, b: Thing) -> tuple[float, float]:
        """The least and the greatest distance between their centres [m]."""
        one, two = self._area(a), self._area(b)
        gap = np.maximum(0, np.maximum(one.min(0) - two.max(0), two.min(0) - one.max(0)))
        reach = np.maximum(one.max(0) - two.min(0), two.max(0) - one.min(0))
        return float(np.hypot(*gap)), float(np.hypot(*reach))

    def _area(self, thing: Thing) -> Array:
        """Corners (4, 2) [m] of the area in which its centre is."""
        region = self.task.belief.regions[self.members[thing.id]]
        low, high = _bounds(region.offset)
        corners = np.array([[x[0], y[1]] for x, y in product((low, high), repeat=2)])
        return np.asarray(corners + np.array(region.center))


def _bounds(offset: Distribution) -> tuple[Array, Array]:
    low: Any
    high: Any
    if offset.uniform is not None:
        low, high = offset.uniform
    elif offset.normal is not None:
        mean, sigma = (np.asarray(v) for v in offset.normal)
        low, high = mean - SIGMAS * sigma, mean + SIGMAS * sigma
    elif offset.choice is not None:
        low, high = np.min(offset.choice, axis=0), np.max(offset.choice, axis=0)
    else:
        low = high = offset.constant or 0.0
    return np.broadcast_to(low, 2), np.broadcast_to(high, 2)


def _only(things: Sequence[Thing], beats: Callable[[Thing, Thing], bool]) -> Thing | None:
    """The one that beats every other."""
    return next((t for t in things if all(t is o or beats(t, o) for o in things)), None)
