"""Adds the place of an object on which a step failed to those noted before."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gap_runtime.contracts.tool import ScriptContext
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Vec3


class Noted(NamedTuple):
    """Middles of the objects on which a step failed [m], the latest last."""

    failed_at: list[Annotated[Vec3, WORLD]]


def run(
    ctx: ScriptContext,
    target_obb: Annotated[OrientedBoundingBox, WORLD] | None = None,
    failed_before: list[Annotated[Vec3, WORLD]] | None = None,
) -> Noted:
    """The places, one more than before."""
    return Noted([*(failed_before or []), *([target_obb.center] if target_obb is not None else [])])
