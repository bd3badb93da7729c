"""Perception tools served from pixels and object models: `observation.*`, detection, segmentation, questions."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_perception import detect, language, observation, segment

    for module in (observation, detect, segment, language):
        for tool in module.TOOLS:
            register(tool)
