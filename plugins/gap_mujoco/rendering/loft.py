"""Packaging shapes as textured meshes: superellipse cross-sections lofted along z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gap_runtime.contracts.types import Array

_SEGMENTS = 48


class Section(NamedTuple):
    """A cross-section: height and half-widths along x and y, as shares of the full ones."""

    z: float
    x: float = 1.0
    y: float = 1.0


@dataclass(frozen=True)
class Mesh:
    """Triangles: `vertices` (N, 3) [m], `faces` (M, 3), `texcoords` (N, 2) with v down from the image's top row."""

    vertices: Array
    faces: Array
    texcoords: Array


def loft_side(size: tuple[float, float, float], sections: Sequence[Section], exponent: float) -> Mesh:
    """The wall of a body of full `size` [m] centred on the origin; u runs once around, v down from the top.

    Superellipse |x/a|^n + |y/b|^n = 1: exponent 2 is an ellipse, 20 nearly a rectangle. The seam is at +x, -y.
    """
    ring, u = _ring(size[0] / 2, size[1] / 2, exponent)
    n = len(u)
    vertices = np.concatenate(
        [np.column_stack([ring * (s.x, s.y), np.full(n, (s.z - 0.5) * size[2])]) for s in sections]
    )
    texcoords = np.concatenate([np.column_stack([u, np.full(n, 1 - s.z)]) for s in sections])
    a = (np.arange(len(sections) - 1)[:, None] * n + np.arange(n - 1)[None, :]).ravel()
    faces = np.concatenate([np.column_stack([a, a + 1, a + n + 1]), np.column_stack([a, a + n + 1, a + n])])
    return Mesh(vertices, faces, texcoords)


def loft_cap(size: tuple[float, float, float], section: Section, exponent: float, *, up: bool) -> Mesh:
    """The flat end of a loft at `section`, textured as seen from outside with x to the right."""
    ring, _ = _ring(size[0] / 2, size[1] / 2, exponent)
    ring = ring[:-1] * (section.x, section.y)
    n = len(ring)
    z = (section.z - 0.5) * size[2]
    vertices = np.vstack([[0.0, 0.0, z], np.column_stack([ring, np.full(n, z)])])
    half = np.abs(ring).max(axis=0)
    texcoords = 0.5 + 0.5 * vertices[:, :2] / half * (1, -1)
    i = np.arange(n)
    j = (i + 1) % n
    faces = np.column_stack([np.zeros(n, int), i + 1, j + 1] if up else [np.zeros(n, int), j + 1, i + 1])
    return Mesh(vertices, faces, texcoords)


def face_widths(size: tuple[float, float, float], exponent: float) -> list[float]:
    """Widths of the label panels around a body, in the order u runs: four faces, or three thirds of a round one [m]."""
    ring, _ = _ring(size[0] / 2, size[1] / 2, exponent)
    around = float(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum())
    if exponent <= 2.5:
        return [around / 3] * 3
    scale = around / (2 * (size[0] + size[1]))
    return [size[1] * scale, size[0] * scale, size[1] * scale, size[0] * scale]


def _ring(a: float, b: float, exponent: float) -> tuple[Array, Array]:
    """Superellipse counter-clockwise from the corner (+x, -y), first point repeated, and its arc-length in 0..1."""
    # Quarters are cut at the corners, so that each panel of the label starts where a face does.
    t = np.linspace(-np.pi / 4, 7 * np.pi / 4, _SEGMENTS + 1)
    c, s = np.cos(t), np.sin(t)
    radius = (np.abs(c) ** exponent + np.abs(s) ** exponent) ** (-1 / exponent)
    ring = np.column_stack([a * radius * c, b * radius * s])
    ring[-1] = ring[0]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    return ring, length / length[-1]
