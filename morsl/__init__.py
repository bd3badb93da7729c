"""MORSL, the Modular Open Robot Skill Library: registers every skill directory below this one."""

from __future__ import annotations

from pathlib import Path

from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_skills(register: Register) -> None:
    register(Path(__file__).parent)
