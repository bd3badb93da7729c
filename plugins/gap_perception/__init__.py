"""Perception tools served from pixels and object models: `observation.*`, detection, segmentation, questions."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_perception import detect, language, mesh, observation, segment, tracker

    for module in (observation, detect, segment, language, tracker, mesh):
        for tool in module.TOOLS:
            register(tool)
