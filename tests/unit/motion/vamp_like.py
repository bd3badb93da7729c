"""A module with VAMP's interface whose models are our own arms, and whose searches give the paths they are told to."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from gap_catalogue.shared.robot_chain import chain, sphere_centers


class Sphere:
    def __init__(self, center, radius):
        self.x, self.y, self.z = (float(v) for v in center)
        self.r = float(radius)


class Cuboid:
    """Turned by angles about the fixed x, y and z axes, in that order."""

    def __init__(self, center, euler_xyz, half_extents):
        self.center, self.half = np.array(center), np.array(half_extents)
        x, y, z = euler_xyz
        self.axes = Rotation.from_rotvec([0, 0, z]) * Rotation.from_rotvec([0, y, 0]) * Rotation.from_rotvec([x, 0, 0])

    def gaps(self, points):
        local = (points - self.center) @ self.axes.as_matrix()
        return np.linalg.norm(np.maximum(np.abs(local) - self.half, 0.0), axis=1)


class Attachment:
    def __init__(self, relative_frame):
        self.relative_frame, self.spheres = np.array(relative_frame), []

    def add_spheres(self, spheres):
        self.spheres += spheres


class Environment:
    def __init__(self):
        self.cuboids, self.spheres, self.attached = [], [], None

    def add_cuboid(self, cuboid):
        self.cuboids.append(cuboid)

    def add_sphere(self, sphere):
        self.spheres.append(sphere)

    def attach(self, attachment):
        self.attached = attachment

    def touches(self, rows):
        """Whether spheres, rows of centre and radius (S, 4), touch anything."""
        gaps = [cuboid.gaps(rows[:, :3]) for cuboid in self.cuboids]
        gaps += [np.linalg.norm(rows[:, :3] - (s.x, s.y, s.z), axis=1) - s.r for s in self.spheres]
        return any((gap < rows[:, 3]).any() for gap in gaps)


class RRTCSettings:
    range, max_iterations, max_samples = 2.0, 100_000, 100_000


class AORRTCSettings:
    def __init__(self):
        self.rrtc, self.max_iterations, self.max_samples = RRTCSettings(), 100_000, 100_000


class Halton:
    def __init__(self):
        self.skipped = 0

    def skip(self, count):
        self.skipped += count


class Arm:
    """A model of one of our arms. `answer(start, goals, world, rng)` gives the waypoints of a search, or None."""

    def __init__(self, spec, answer):
        self.spec, self.answer, self.asked = spec, answer, []
        self.tip, self.bend, self.touching_itself = chain(spec).tcp, 0.0, lambda q: False
        self.fat, self.improves = 0.0, True
        model = self

        class Path(list):
            def append(self, row):
                assert all(isinstance(x, float) for x in row)
                super().append(row)

            def numpy(self):
                return np.array(self, dtype=np.float32)

            def validate(self, world):
                return all(model.validate(row, world) for row in self)

        self.Path = Path

    def dimension(self):
        return self.spec.dof

    def n_spheres(self):
        return len(self.spec.spheres)

    def fk(self, q):
        centers = sphere_centers(self.spec, q)
        return [Sphere(c, s.radius + self.fat) for c, s in zip(centers, self.spec.spheres, strict=True)]

    def eefk(self, q):
        T = chain(self.spec).poses(np.array(q), self.tip)[0]
        T[2, 3] += self.bend * np.sin(q[0])
        return T.astype(np.float32)

    def validate(self, q, world):
        rows = np.array([(s.x, s.y, s.z, s.r) for s in self.fk(q)])
        return not self.touching_itself(np.array(q)) and not world.touches(rows)

    def halton(self):
        return Halton()

    def rrtc(self, start, goals, world, settings, rng):
        self.asked.append(SimpleNamespace(start=start, goals=goals, cell=world, settings=settings, rng=rng))
        rows = self.answer(np.array(start), np.array(goals), world, rng)
        path = self.Path()
        for row in () if rows is None else rows:
            path.append([float(x) for x in row])
        return SimpleNamespace(solved=len(path) > 1, path=path)

    def aorrtc(self, start, goals, world, settings, rng):
        found = self.rrtc(start, goals, world, settings, rng)
        return found if self.improves else SimpleNamespace(solved=False)

    def simplify(self, path, world, settings, rng):
        return SimpleNamespace(path=path)


def straight(start, goals, world, rng):
    """Straight to the first goal, whatever is in the way."""
    return [start, goals[0]]


def vamp_like(spec, answer=straight):
    """The module, with one model, of `spec`, under its name."""
    return SimpleNamespace(
        robots=[spec.name], ROBOT_RRT_RANGES={spec.name: 1.0}, Sphere=Sphere, Cuboid=Cuboid, Attachment=Attachment,
        Environment=Environment, RRTCSettings=RRTCSettings, AORRTCSettings=AORRTCSettings,
        SimplifySettings=SimpleNamespace, **{spec.name: Arm(spec, answer)},
    )  # fmt: skip
