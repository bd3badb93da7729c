"""Learned networks, endpoints and research packages: provider `hf` of names that other plugins serve embedded."""

from __future__ import annotations

from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_hf.grasps import graspgen, graspnet, m2t2
    from gap_hf.language import molmo, vlm
    from gap_hf.vision import detect, segment, tracker

    for module in (detect, segment, tracker, molmo, vlm, graspgen, graspnet, m2t2):
        for tool in module.TOOLS:
            register(tool)
