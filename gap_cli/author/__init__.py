"""Who writes graphs: the symbolic author, from a sentence to a plan, and from a plan to a validated workflow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gap_cli.author.plans import Plan
from gap_cli.skills import SkillLibrary
from gap_runtime.contracts.documents import check_text
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import DocumentError, InstructionError, UnknownNameError

if TYPE_CHECKING:
    from gap_cli.author.build import Generated

AUTHORS = ("symbolic",)
MAX_INSTRUCTION = 2000  # characters; far above any instruction, far below what would take time
__all__ = ["AUTHORS", "Plan", "generate", "plan"]


def plan(
    task: Task, instruction: str, library: SkillLibrary, tools: Mapping[str, ToolSpec], author: str = "symbolic"
) -> Plan:
    """The plan for an instruction. Raises `InstructionError` where it cannot be served."""
    from gap_cli.author.symbolic import plan_symbolically

    if author not in AUTHORS:
        raise UnknownNameError("author", author, AUTHORS)
    return plan_symbolically(task, read_instruction(instruction), library, tools)


def read_instruction(text: str) -> str:
    """The instruction on one line. Raises `InstructionError` where it is too long or holds what nobody can see."""
    if len(text) > MAX_INSTRUCTION:
        long = f"The instruction has {len(text)} characters; at most {MAX_INSTRUCTION} are read."
        raise InstructionError(long, hint="Give it in several runs.")
    try:
        return " ".join(check_text(text, "The instruction").split())
    except DocumentError as error:
        raise InstructionError(error.message + ".", hint="Type it again.") from None


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
