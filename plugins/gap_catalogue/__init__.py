"""The contract of every catalogue tool, once: providers serve them, graphs call them by name."""

from __future__ import annotations

import importlib

from gap_runtime.contracts.policy import Act
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.hookspecs import Register, hookimpl

MODULES = (
    "observation", "detection", "segmentation", "tracking", "meshes", "language", "grasps", "geometry", "curobo",
    "pyroki", "robot_control", "gripper", "clock", "sim_bridge",
)  # fmt: skip


@hookimpl
def gap_register_contracts(register: Register) -> None:
    register(Act)
    for name in MODULES:
        for value in vars(importlib.import_module(f"{__name__}.{name}")).values():
            if isinstance(value, type) and issubclass(value, ToolRequest) and value is not ToolRequest:
                register(value)
