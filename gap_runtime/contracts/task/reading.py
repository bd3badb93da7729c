"""What the validators of a task may ask for while it is read: its folder, and what is installed around it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationInfo

from gap_runtime.contracts.robot import RobotSpec


@dataclass(frozen=True)
class Installed:
    """What a task must agree with outside of it: the `name` it is found by, the names of the simulators, and the spec
    of each robot (raises `GapError`)."""

    name: str
    simulators: Collection[str]
    robot: Callable[[str], RobotSpec]


@dataclass(frozen=True)
class Reading:
    """The context of a validation: where relative paths begin, and what is installed, where that is known."""

    folder: Path = Path()
    installed: Installed | None = None


def folder_of(info: ValidationInfo) -> Path:
    """The task's folder; the working directory for a document that is read alone."""
    return info.context.folder if isinstance(info.context, Reading) else Path()


def installed_of(info: ValidationInfo) -> Installed | None:
    """What is installed, where the reader said so."""
    return info.context.installed if isinstance(info.context, Reading) else None
