"""Motion tools (`robot_control.*`, `gripper.*`, `pyroki.*`, `curobo.*`), all of them from the RobotSpec alone."""

from __future__ import annotations

from typing import Any

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_motion import (
        tools_arms,
        tools_check,
        tools_control,
        tools_gripper,
        tools_lines,
        tools_plan,
        tools_pyroki,
        tools_torch,
        vamp_arm,
        vamp_tools,
    )

    modules = [
        tools_control,
        tools_arms,
        tools_gripper,
        tools_pyroki,
        tools_torch,
        tools_plan,
        tools_lines,
        tools_check,
    ]
    if vamp_arm.installed():
        modules.append(vamp_tools)
    for module in modules:
        for tool in module.TOOLS:
            register(tool)


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    def motion(progress: Any) -> Any:
        from gap_motion.bench import motion

        return motion(progress)

    register("motion", motion)
