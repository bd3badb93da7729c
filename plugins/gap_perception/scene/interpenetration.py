"""Two bodies cannot be in one place: tells when fitted models go into each other deeper than fits are wrong."""

from __future__ import annotations

import numpy as np

from gap_perception.scene.fit import Fit, signed_depth
from gap_perception.scene.visibility import SAMPLES

DEEP = 0.008  # m: fits of touching objects go into each other by less
SHARE = 0.1  # of a model's surface


def interpenetrate(a: Fit, b: Fit, blur: float = 0.0) -> bool:
    """True when more than `SHARE` of one model's surface is deeper than `DEEP` + `blur` [m] inside the other."""
    radii = sum(float(np.linalg.norm(f.surface.model.shape.size)) / 2 for f in (a, b))
    if np.linalg.norm(a.position - b.position) >= radii:
        return False
    return max(_inside(a, b, DEEP + blur), _inside(b, a, DEEP + blur)) > SHARE


def _inside(a: Fit, b: Fit, deep: float) -> float:
    """Share of `a`'s surface that is deeper than `deep` [m] inside `b`."""
    points = a.surface.points[:: max(1, len(a.surface.points) // SAMPLES)]
    local = b.local(points @ a.rotation.T + a.position)
    return float((signed_depth(b.surface, local) > deep).mean())
