"""`gap tasks`: the installed tasks, their variants, objects and instructions."""

from __future__ import annotations

from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, complete_task, console, print_json, print_table

if TYPE_CHECKING:
    from gap_runtime.contracts.task import Task


app = typer.Typer(name="tasks", help="The tasks graphs are planned for.", no_args_is_help=True)


@app.command("list")
def list_tasks(json: AsJson = False) -> None:
    """List the installed tasks."""
    from gap_cli.workspace.tasks import find_tasks, open_task
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    listed = [_as_dict(open_task(registry, known)) for known in find_tasks(registry)]
    if json:
        print_json(listed)
        return
    rows = [(t["name"], ", ".join(t["variants"]), len(t["objects"]), t["description"]) for t in listed]
    print_table("", ("task", "variants", "objects", ""), rows)


@app.command()
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A task.", autocompletion=complete_task)],
    json: AsJson = False,
) -> None:
    """Show one task: its objects, variants and instructions."""
    from gap_cli.workspace.tasks import open_task
    from gap_runtime.plugins import load_registry

    task = open_task(load_registry(), name)
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
        out.print(f"  gap plan --task {task.name} --say {quote(instruction)}", markup=False, soft_wrap=True)


def _as_dict(task: Task) -> dict[str, Any]:
    return {
        "name": task.name, "description": task.description, "variants": list(task.variants),
        "objects": {key: model.label for key, model in task.objects.items()}, "scenes": list(task.scenes),
        "robots": [placement.model for placement in task.robots], "instructions": task.instructions,
        "path": str(task.path),
    }  # fmt: skip
