"""Perception tools served by learned networks and by endpoints: provider `hf` of the names `gap_perception` embeds."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_hf import detect, graspgen, graspnet, m2t2, molmo, segment, tracker, vlm

    for module in (detect, segment, tracker, molmo, vlm, graspgen, graspnet, m2t2):
        for tool in module.TOOLS:
            register(tool)
