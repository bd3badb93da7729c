"""The robot as collision checking sees it: spheres that ride on its frames, in parts of a handful each.

A part has a sphere around it, so that the scene is compared with parts first. Which parts could ever meet each other
is found once per robot by sampling. Numbers are single precision: microns at arm's length, and twice as fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from gap_catalogue.shared.robot_chain import Chain, joint_range
from gap_motion.kinematics.damped_least_squares import halton_seeds
from gap_runtime.contracts.robot import CollisionSphere
from gap_runtime.contracts.types import Array

PART = 0.11  # m: links longer than that are cut into parts
SMALL = 0.05  # m: a part no larger counts as its one bounding sphere when the robot could touch itself
SAMPLES, NEAR = 2000, 0.03  # configurations looked at, and m between parts that count as able to meet
STATIC = -1


@dataclass(frozen=True, eq=False)
class LinkSpheres:
    """Spheres fixed behind joint `frame` (`STATIC`: to the base): `centers` (k, 3) [m] in that frame, `radii` (k,)."""

    link: str
    frame: int
    centers: Array
    radii: Array

    @cached_property
    def middle(self) -> Array:
        """Centre of the sphere around the part, shape (3,)."""
        low, high = (self.centers - self.radii[:, None]).min(axis=0), (self.centers + self.radii[:, None]).max(axis=0)
        return np.asarray((low + high) / 2)

    @cached_property
    def reach(self) -> float:
        """Radius of the sphere around the part [m]."""
        return float((np.linalg.norm(self.centers - self.middle, axis=1) + self.radii).max())


@dataclass(frozen=True, eq=False)
class RobotCollisionModel:
    """All parts, the pairs of them that could meet (P, 2), and which parts may touch what is being grasped."""

    parts: tuple[LinkSpheres, ...]
    pairs: Array
    grippers: frozenset[int]


def collision_model(chain: Chain, width: float) -> RobotCollisionModel:
    """The robot with its jaws `width` [m] open; jaws are told apart to a tenth of a millimetre."""
    return _collision_model(chain, round(width, 4))


@lru_cache(maxsize=64)
def _collision_model(chain: Chain, width: float) -> RobotCollisionModel:
    parts = _parts(chain, width)
    last = chain.dof - 1
    hand = {n for n, k in chain.links.items() if k.frame == last and (k.slide.any() or n == chain.spec.flange_link)}
    grippers = frozenset(i for i, part in enumerate(parts) if part.link in hand)
    return RobotCollisionModel(parts, _meeting(chain, parts), grippers)


def _parts(chain: Chain, width: float) -> tuple[LinkSpheres, ...]:
    parts: list[LinkSpheres] = []
    for name in dict.fromkeys(s.link for s in chain.spec.spheres):
        link, spheres = chain.links[name], [s for s in chain.spec.spheres if s.link == name]
        offset = link.transform[:3, 3] + link.slide * width
        centers = np.array([link.transform[:3, :3] @ s.center + offset for s in spheres])
        parts += _cut(LinkSpheres(name, link.frame, centers, np.array([s.radius for s in spheres])))
    return tuple(parts)


def _cut(part: LinkSpheres) -> list[LinkSpheres]:
    """Split a part along its longest direction until every piece is small."""
    if part.reach <= PART or len(part.centers) == 1:
        return [part]
    longest = int(np.argmax(part.centers.max(axis=0) - part.centers.min(axis=0)))
    order = np.argsort(part.centers[:, longest], kind="stable")
    halves = np.array_split(order, 2)
    return [
        p for half in halves for p in _cut(LinkSpheres(part.link, part.frame, part.centers[half], part.radii[half]))
    ]


def with_attached(
    body: RobotCollisionModel, name: str, spheres: Sequence[CollisionSphere], frame: int
) -> RobotCollisionModel:
    """The robot holding an object, whose spheres are given in the frame behind the last joint.

    The object may touch the hand; it is checked against all links that do not move with the last two joints.
    """
    centers, radii = np.array([s.center for s in spheres]), np.array([s.radius for s in spheres])
    held = _cut(LinkSpheres(name, frame, centers, radii))
    first = len(body.parts)
    others = [i for i, part in enumerate(body.parts) if part.frame < frame - 1]
    more = np.array([(i, first + k) for i in others for k in range(len(held))], dtype=int).reshape(-1, 2)
    return RobotCollisionModel((*body.parts, *held), np.concatenate([body.pairs, more]), body.grippers)


def _meeting(chain: Chain, parts: Sequence[LinkSpheres]) -> Array:
    """Pairs of parts that can touch in some configuration and are not neighbours, shape (P, 2)."""
    ignored = {frozenset(pair) for pair in chain.spec.self_collision_ignore}
    candidates = [
        (k, i)
        for i, a in enumerate(parts)
        for k, b in enumerate(parts[:i])
        if abs(a.frame - b.frame) > 1 and frozenset((a.link, b.link)) not in ignored
    ]
    pairs = np.array(candidates, dtype=int).reshape(-1, 2)
    low, high = joint_range(chain.spec)
    frames = chain.frames(halton_seeds(low, high, SAMPLES))
    middles = np.empty((SAMPLES, len(parts), 3))
    for i, part in enumerate(parts):
        T = np.eye(4)[None] if part.frame == STATIC else frames[part.frame]
        middles[:, i] = T[:, :3, :3] @ part.middle + T[:, :3, 3]
    reach = np.array([part.reach for part in parts])
    gaps = np.linalg.norm(middles[:, pairs[:, 0]] - middles[:, pairs[:, 1]], axis=2)
    return np.asarray(pairs[gaps.min(axis=0) < reach[pairs].sum(axis=1) + NEAR])
