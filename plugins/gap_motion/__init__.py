"""Motion tools (`robot_control.*`, `gripper.*`, `pyroki.*`, `curobo.*`), all of them from the RobotSpec alone."""

from __future__ import annotations

from typing import Any

from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_motion.tools import arms as tools_arms
    from gap_motion.tools import check as tools_check
    from gap_motion.tools import clock as tools_clock
    from gap_motion.tools import control as tools_control
    from gap_motion.tools import gripper as tools_gripper
    from gap_motion.tools import lines as tools_lines
    from gap_motion.tools import plan as tools_plan
    from gap_motion.tools import pyroki as tools_pyroki
    from gap_motion.tools import torch as tools_torch
    from gap_motion.vamp import arm as vamp_arm
    from gap_motion.vamp import tools as vamp_tools

    modules = [
        tools_control,
        tools_arms,
        tools_gripper,
        tools_pyroki,
        tools_torch,
        tools_plan,
        tools_lines,
        tools_check,
        tools_clock,
    ]
    if vamp_arm.installed():
        modules.append(vamp_tools)
    for module in modules:
        for tool in module.TOOLS:
            register(tool)


@hookimpl
def gap_register_policies(register: Register) -> None:
    from gap_motion.hold import HoldStill

    register("hold", HoldStill)


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    def motion(progress: Any) -> Any:
        from gap_motion.bench.motion import motion

        return motion(progress)

    register("motion", motion)
