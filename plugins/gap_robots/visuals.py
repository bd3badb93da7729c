"""The manufacturer's meshes of a robot, from the data-only package rtb-data where it is installed."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from gap_runtime.contracts.robot import VisualMesh

SHELL = (0.93, 0.93, 0.92, 1.0)
DARK = (0.22, 0.23, 0.25, 1.0)


def panda_visuals() -> tuple[VisualMesh, ...]:
    """Of the Panda and its hand; none when they are not installed, and its collision shapes are drawn."""
    found = importlib.util.find_spec("rtbdata")
    if found is None or not found.submodule_search_locations:
        return ()
    folder = Path(next(iter(found.submodule_search_locations))) / "meshes" / "FRANKA-EMIKA" / "Panda"
    if not folder.is_dir():
        return ()
    return (
        *(VisualMesh(f"panda_link{i}", folder / f"link{i}.stl", SHELL) for i in range(8)),
        VisualMesh("panda_hand", folder / "hand.stl", SHELL),
        VisualMesh("panda_leftfinger", folder / "finger.stl", DARK),
        VisualMesh("panda_rightfinger", folder / "finger.stl", DARK),
    )
