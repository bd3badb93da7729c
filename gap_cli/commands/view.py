"""`gap view`: the graph, and what happened in its last run, as a tree, a page and Mermaid."""

from __future__ import annotations

from typing import Annotated

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, RunName, console, print_done, print_json


def view(
    run: RunName = None,
    mermaid: Annotated[bool, typer.Option("--mermaid", help="Print Mermaid text and nothing else.")] = False,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Show the graph in the terminal and write view.html (self-contained) and graph.mmd."""
    from gap_cli.report.view import read_view
    from gap_cli.workspace.run import Run

    opened = Run.open(root, run)
    shown = read_view(opened)
    if mermaid:
        typer.echo(shown.mermaid, nl=False)
        return
    with opened.held():
        files = shown.write()
    if json:
        status = None if shown.timeline is None else shown.timeline.status
        print_json({"run": opened.name, "page": str(files[0]), "mermaid": str(files[1]), "last_run": status})
        return
    console().print(shown.tree())
    print_done(opened, "", [f"page:    {files[0]}", f"mermaid: {files[1]}"])
