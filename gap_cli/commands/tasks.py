"""`gap tasks`: the installed tasks, their variants, objects and instructions."""

from __future__ import annotations

import logging
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, complete_task, console, print_json, print_table

if TYPE_CHECKING:
    from gap_runtime.contracts.task import Task
    from gap_runtime.plugins import LeftOut, Registry


log = logging.getLogger(__name__)
app = typer.Typer(name="tasks", help="The tasks graphs are planned for.", no_args_is_help=True)


@app.command("list")
def list_tasks(json: AsJson = False) -> None:
    """List the installed tasks."""
    from gap_runtime.plugins import load_registry

    listed = [_as_dict(task) for task in open_tasks(load_registry())[0]]
    if json:
        print_json(listed)
        return
    rows = [(t["name"], ", ".join(t["variants"]), len(t["objects"]), t["description"]) for t in listed]
    print_table("", ("task", "variants", "objects", ""), rows)


def open_tasks(registry: Registry) -> tuple[list[Task], dict[str, LeftOut]]:
    """Every installed task, and those that cannot be read, each with a warning that names plugin and file."""
    from gap_cli.workspace.tasks import find_tasks, open_task
    from gap_runtime.errors import GapError
    from gap_runtime.plugins import LeftOut

    tasks: list[Task] = []
    left_out: dict[str, LeftOut] = {}
    for name, folder in find_tasks(registry).items():
        try:
            tasks.append(open_task(registry, name))
        except GapError as error:
            plugin = next((p for path, p in registry.task_paths if folder.is_relative_to(path)), "")
            left_out[name] = LeftOut(plugin, error)
            log.warning("task %s left out: %s", name, left_out[name])
    return tasks, left_out


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


@app.command()
def check(
    paths: Annotated[list[Path], typer.Argument(metavar="PATH...", help="Task folders, folders of them, task.yaml.")],
    json: AsJson = False,
) -> None:
    """Check tasks in all their variants. Exit code 1 for problems."""
    from gap_cli.workspace.tasks import task_folders, task_problems
    from gap_runtime.errors import DocumentError
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    found: dict[str, list[str]] = {}
    for path in paths:
        folders = task_folders(path)
        if not folders:
            raise DocumentError(str(path), "holds no task.yaml, and no folders that do")
        found |= {str(folder): task_problems(registry, folder) for folder in folders}
    rows = [(folder, problem) for folder, problems in found.items() for problem in problems]
    if json:
        print_json([{"task": folder, "problem": problem} for folder, problem in rows])
    else:
        for folder, problem in rows:
            console().print(f"{folder}: {problem}", markup=False, soft_wrap=True)
        console().print(f"{len(found)} checked, {len(rows)} problem{'' if len(rows) == 1 else 's'}", markup=False)
    if rows:
        raise typer.Exit(1)


def _as_dict(task: Task) -> dict[str, Any]:
    return {
        "name": task.name, "description": task.description, "variants": list(task.variants),
        "objects": {key: model.label for key, model in task.objects.items()}, "scenes": list(task.scenes),
        "robots": [placement.model for placement in task.robots], "instructions": task.instructions,
        "path": str(task.path),
    }  # fmt: skip
