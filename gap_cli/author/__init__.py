"""Who writes graphs: the symbolic author, from a sentence to a plan, and from a plan to a validated workflow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gap_cli.author.plans import Plan
from gap_cli.skills import SkillLibrary
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import UnknownNameError

if TYPE_CHECKING:
    from gap_cli.author.build import Generated

AUTHORS = ("symbolic",)
__all__ = ["AUTHORS", "Plan", "generate", "plan"]


def plan(
    task: Task, instruction: str, library: SkillLibrary, tools: Mapping[str, ToolSpec], author: str = "symbolic"
) -> Plan:
    """The plan for an instruction. Raises `InstructionError` where it cannot be served."""
    from gap_cli.author.symbolic import plan_symbolically

    if author not in AUTHORS:
        raise UnknownNameError("author", author, AUTHORS)
    return plan_symbolically(task, instruction, library, tools)


def generate(
    plan: Plan | Mapping[str, Any],
    task: Task,
    library: SkillLibrary,
    tools: Mapping[str, ToolSpec],
    *,
    unsafe: bool = False,
) -> Generated:
    """The workflow of a plan, written, run in the sandbox and validated; see `gap_cli.author.build`."""
    from gap_cli.author.build import build

    return build(plan, task, library, tools, unsafe=unsafe)
