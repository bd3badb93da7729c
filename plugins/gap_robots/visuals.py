"""Looks for a robot: the manufacturer's meshes from the data-only package rtb-data, where it is installed.

Without it the collision shapes are what one sees. Looks never touch: they have no collision bits and no mass.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gap_runtime.contracts.robot import RobotSpec

SHELL = (0.93, 0.93, 0.92, 1.0)
DARK = (0.22, 0.23, 0.25, 1.0)
LOOKS_GROUP, HIDDEN_GROUP = 1, 3  # MuJoCo's renderers draw groups 0 to 2 unless told otherwise


@dataclass(frozen=True)
class Look:
    """One mesh on one body, both in the body's own frame."""

    file: str
    rgba: tuple[float, float, float, float] = SHELL


PANDA: Mapping[str, Look] = {
    **{f"panda_link{i}": Look(f"link{i}.stl") for i in range(8)},
    "panda_hand": Look("hand.stl"),
    "panda_leftfinger": Look("finger.stl", DARK),
    "panda_rightfinger": Look("finger.stl", DARK),
}
LOOKS: Mapping[str, tuple[str, Mapping[str, Look]]] = {"panda": ("FRANKA-EMIKA/Panda", PANDA)}


def mesh_folder(robot: str) -> Path | None:
    """Where the meshes for a model file of this name are, or None when they are not installed."""
    found = importlib.util.find_spec("rtbdata")
    if robot not in LOOKS or found is None or not found.submodule_search_locations:
        return None
    folder = Path(next(iter(found.submodule_search_locations))) / "meshes" / LOOKS[robot][0]
    return folder if folder.is_dir() else None


def add_looks(model: Any, spec: RobotSpec) -> bool:
    """Give a robot's `dm_control.mjcf` model its meshes and hide its collision shapes; call it before attaching.

    Returns False, and changes nothing, when there are no meshes for it here.
    """
    from dm_control import mjcf

    folder = mesh_folder(spec.model_file.stem)
    if folder is None:
        return False
    looks = LOOKS[spec.model_file.stem][1]
    for body in model.find_all("body"):
        look = looks.get(body.name)
        if look is None:
            continue
        for geom in body.geom:
            geom.group = HIDDEN_GROUP
        mesh = model.find("mesh", Path(look.file).stem) or model.asset.add(
            "mesh", name=Path(look.file).stem, file=mjcf.Asset((folder / look.file).read_bytes(), ".stl")
        )
        body.add(
            "geom", name=f"{body.name}_look", type="mesh", mesh=mesh, rgba=look.rgba,
            contype=0, conaffinity=0, group=LOOKS_GROUP, mass=0,
        )  # fmt: skip
    return True
