"""Motion tools (`robot_control.*`, `gripper.*`, `pyroki.*`, `curobo.*`), all of them from the RobotSpec alone."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_motion import tools_arms, tools_check, tools_control, tools_gripper, tools_lines, tools_plan, tools_pyroki

    for module in (tools_control, tools_arms, tools_gripper, tools_pyroki, tools_plan, tools_lines, tools_check):
        for tool in module.TOOLS:
            register(tool)
