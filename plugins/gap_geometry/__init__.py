"""Geometry tools (`geometry_svc.*`): clouds, boxes, grasp poses and collision worlds from calibrated depth."""

from __future__ import annotations

from typing import Any

from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_geometry import boxes, clouds, grasps, placement, scene

    for module in (clouds, boxes, grasps, placement, scene):
        for tool in module.TOOLS:
            register(tool)


@hookimpl
def gap_register_preparations(register: Register) -> None:
    register("geometry libraries", _load_libraries)


def _load_libraries(ctx: Any) -> None:
    """Import what the first call would otherwise wait for."""
    import cv2  # noqa: F401
    import sklearn.cluster  # noqa: F401
