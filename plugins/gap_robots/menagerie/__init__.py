"""Arms from a MuJoCo Menagerie checkout (`MENAGERIE_ROOT`), registered as `menagerie:<folder>`.

Menagerie models differ in names, actuators and grippers; `adapt` gives each the form GaP's worlds and planners expect,
and `describe` reads the RobotSpec off the result. What a model does not say is chosen on the safe side and marked so.
"""

from __future__ import annotations

import os
import warnings
from functools import cache, partial
from pathlib import Path

from gap_runtime.contracts.failures import DocumentError, GapError, UnknownNameError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.hookspecs import Register

VARIABLE = "MENAGERIE_ROOT"
PREFIX = "menagerie:"


def register_all(register: Register) -> None:
    """Register every folder of the checkout that holds a model; building one waits until it is asked for."""
    for folder in folders():
        register(PREFIX + folder.name, partial(menagerie, folder.name))


def folders() -> list[Path]:
    """The model folders below `MENAGERIE_ROOT`; none when the variable is unset or points nowhere."""
    root = os.environ.get(VARIABLE, "")
    if not root or not Path(root).is_dir():
        return []
    return sorted(path for path in Path(root).iterdir() if path.is_dir() and _models(path))


@cache
def menagerie(name: str) -> RobotSpec:
    """The spec of one folder's arm. Raises `UnknownNameError`, `DocumentError` with the reason when its model cannot be
    read, or is not one arm with a parallel jaw or a place for one."""
    from gap_robots.menagerie.adapt import adapt
    from gap_robots.menagerie.describe import describe

    found = {path.name: path for path in folders()}
    if name not in found:
        raise UnknownNameError("Menagerie model", name, found)
    source = _models(found[name])[0]
    try:
        with warnings.catch_warnings(action="ignore"):  # about options of the file, which the scene's own replace
            return describe(adapt(source, name), PREFIX + name)
    except GapError:
        raise
    except Exception as error:  # MuJoCo's reader and compiler raise what they like
        reason = "; ".join(str(error).strip().splitlines()) or type(error).__name__
        raise DocumentError(str(source), f"cannot be used as an arm: {reason}") from None


def _models(folder: Path) -> list[Path]:
    """MJCF files of a folder that are robots, the one named like the robot first."""
    files = [p for p in sorted(folder.glob("*.xml")) if not p.name.startswith(("scene", "mjx_"))]
    words = folder.name.split("_")
    return sorted(files, key=lambda p: (p.stem not in words, len(p.stem), p.stem))
