"""`gap schema`: the JSON Schema of a document, for editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import print_json

if TYPE_CHECKING:
    from pydantic import BaseModel

KINDS = ("workflow", "contract", "task", "run", "goals")


def schema(
    kind: Annotated[
        str, typer.Argument(help=f"One of {', '.join(KINDS)}.", autocompletion=lambda: list(KINDS), metavar="KIND")
    ],
) -> None:
    """Print the JSON Schema of a workflow, a skill's contract, a task, a run or goals."""
    print_json(schema_of(kind))


def schema_of(kind: str) -> dict[str, Any]:
    """The schema. Raises `UnknownNameError`."""
    from gap_cli.validate.schema import json_schema
    from gap_cli.workspace.run import RunConfig
    from gap_runtime.contracts.skill import SkillContract
    from gap_runtime.contracts.task import Task
    from gap_runtime.contracts.task.goals import Goals
    from gap_runtime.errors import UnknownNameError
    from gap_runtime.graph.model import Workflow

    models: dict[str, type[BaseModel]] = {
        "workflow": Workflow,
        "contract": SkillContract,
        "task": Task,
        "run": RunConfig,
        "goals": Goals,
    }
    if kind not in models:
        raise UnknownNameError("kind of document", kind, KINDS)
    return json_schema(models[kind], kind, leave_out=("path", "variant") if kind == "task" else ())
