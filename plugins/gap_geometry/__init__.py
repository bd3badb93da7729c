"""Geometry tools (`geometry_svc.*`): clouds, boxes, grasp poses and collision worlds from calibrated depth."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_geometry import boxes, clouds, grasps, placement, scene

    for module in (clouds, boxes, grasps, placement, scene):
        for tool in module.TOOLS:
            register(tool)
