"""Motion tools (`robot_control.*`, `gripper.*`, `pyroki.*`, `curobo.*`), all of them from the RobotSpec alone."""

from __future__ import annotations

from gap_runtime.contracts.bench import BenchContext, BenchReport
from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_motion.curobo import tools as with_curobo
    from gap_motion.tools import arms, check, clock, control, gripper, lines, plan, pyroki, torch
    from gap_motion.vamp import tools as with_vamp
    from gap_motion.vamp.arm import installed

    modules = (control, arms, gripper, pyroki, torch, plan, lines, check, clock, with_curobo)
    for module in (*modules, with_vamp) if installed() else modules:
        for tool in module.TOOLS:
            register(tool)


@hookimpl
def gap_register_policies(register: Register) -> None:
    from gap_motion.hold import HoldStill

    register("hold", HoldStill)


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    register("motion", _motion)


def _motion(bench: BenchContext) -> BenchReport:
    """Planning, inverse kinematics, collision checks and timing, and what an independent verifier says of them."""
    from gap_motion.bench.motion import motion

    return motion(bench)
