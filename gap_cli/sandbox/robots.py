"""A robot's spec as plain data and back, for scripts in the jail: numbers and names, nothing of the running cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from gap_runtime.contracts.robot import RobotSpec

_SPEC = TypeAdapter(RobotSpec)


def plain(spec: RobotSpec) -> dict[str, Any]:
    """What `spec_of` makes the spec of; the model's file by its name alone and no meshes, since the jail has
    no files."""
    data: dict[str, Any] = _SPEC.dump_python(
        replace(spec, model_file=Path(spec.model_file.name), visuals=()), mode="json"
    )
    return data


def spec_of(data: Mapping[str, Any]) -> RobotSpec:
    """The spec that `plain` was given."""
    return _SPEC.validate_python(data)
