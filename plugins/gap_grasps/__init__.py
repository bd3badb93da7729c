"""Grasp generation on point clouds (`graspgen.*`, `graspnet.*`, `m2t2.*`): antipodal sampling, embedded, no weights."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_grasps import tools

    for tool in tools.TOOLS:
        register(tool)
