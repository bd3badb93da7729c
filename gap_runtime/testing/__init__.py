"""Shipped fakes: a world without physics, an arm without motors and a handful of tools, so that graphs run anywhere."""

from gap_runtime.testing.arm import FAKE_ROBOT, FakeArm, FakeGripper
from gap_runtime.testing.cell import FakeCell
from gap_runtime.testing.graphs import compile_fake, fake_skill, fake_tools, fake_workflow, run_fake
from gap_runtime.testing.tools import FAKE_TOOLS, Sum

__all__ = [
    "FAKE_ROBOT",
    "FAKE_TOOLS",
    "FakeArm",
    "FakeCell",
    "FakeGripper",
    "Sum",
    "compile_fake",
    "fake_skill",
    "fake_tools",
    "fake_workflow",
    "run_fake",
]
