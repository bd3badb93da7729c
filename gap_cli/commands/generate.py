"""`gap generate`: from the plan to a graph."""

from __future__ import annotations

from typing import Annotated

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, RunName, Skills, open_run, print_done, print_json


def generate(
    run: RunName = None,
    unsafe_no_sandbox: Annotated[
        bool, typer.Option(help="Run builder code where the sandbox cannot be set up. Recorded in the run.")
    ] = False,
    skills: Skills = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Lose what was edited in generate/ by hand.")] = False,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Write the graph the plan describes: workflow, subgraphs, scripts, checkpoints."""
    from gap_cli.commands.pipeline import generate_run

    opened = open_run(root, run, skills)
    made = generate_run(opened, unsafe=unsafe_no_sandbox, overwrite=overwrite)
    if json:
        print_json({"run": opened.name, "path": str(opened.folder("generate")), **made})
        return
    line = f"{opened.name}: {made['nodes']} nodes in {made['subgraphs']} subgraphs"
    print_done(opened, "generate", [line], next_step=f"gap validate {opened.argument}")
