"""`gap tasks`: the installed tasks, their variants, objects and instructions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, complete_task, console, print_json, print_table

if TYPE_CHECKING:
    from gap_runtime.contracts.task import Task


def tasks(
    name: Annotated[
        str | None, typer.Argument(metavar="TASK", help="One task, shown in full.", autocompletion=complete_task)
    ] = None,
    json: AsJson = False,
) -> None:
    """List the tasks, or show one in full."""
    from gap_cli.workspace.tasks import find_tasks, open_task
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    if name is not None:
        _one(open_task(registry, name), json)
        return
    listed = [_as_dict(open_task(registry, known)) for known in find_tasks(registry)]
    if json:
        print_json(listed)
        return
    rows = [(t["name"], ", ".join(t["variants"]), len(t["objects"]), t["description"]) for t in listed]
    print_table("", ("task", "variants", "objects", ""), rows)


def _one(task: Task, json: bool) -> None:
    data = _as_dict(task)
    if json:
        print_json(data)
        return
    out = console()
    out.print(task.name, style="bold", markup=False)
    out.print(task.description + "\n", markup=False)
    print_table(
        "", ("object", "label", "also called"), [(k, m.label, ", ".join(m.words)) for k, m in task.objects.items()]
    )
    out.print("\nvariants: " + (", ".join(task.variants) or "none"), markup=False)
    out.print("say for example:", markup=False)
    for instruction in task.instructions:
        out.print(f'  gap plan --task {task.name} --say "{instruction}"', markup=False, soft_wrap=True)


def _as_dict(task: Task) -> dict[str, Any]:
    return {
        "name": task.name, "description": task.description, "variants": list(task.variants),
        "objects": {key: model.label for key, model in task.objects.items()}, "scenes": list(task.scenes),
        "robots": [placement.model for placement in task.robots], "instructions": task.instructions,
        "path": str(task.path),
    }  # fmt: skip
