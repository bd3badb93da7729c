"""Motion tools (`robot_control.*`, `gripper.*`, `pyroki.*`): kinematics, paths and timing from the RobotSpec."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_motion import tools_control, tools_gripper, tools_pyroki

    for module in (tools_control, tools_gripper, tools_pyroki):
        for tool in module.TOOLS:
            register(tool)
