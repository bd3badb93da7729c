"""`gap validate`: every rule over the graph, every finding at once."""

from __future__ import annotations

from enum import StrEnum
from itertools import groupby
from typing import TYPE_CHECKING, Annotated

import typer

from gap_cli.commands.common import (
    RUNS,
    AsJson,
    Root,
    RunName,
    Skills,
    TaskOf,
    open_run,
    print_done,
    print_json,
    print_table,
)

if TYPE_CHECKING:
    from gap_runtime.errors import Finding


class Source(StrEnum):
    """What counts where both were edited."""

    builder = "builder"
    workflow = "workflow"


def validate(
    run: RunName = None,
    task: TaskOf = None,
    skills: Skills = None,
    source: Annotated[
        Source | None, typer.Option(help="What counts where the builder code and workflow.json were both edited.")
    ] = None,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Check the graph against the tools, skills and objects there are. Exit 1 where an error is found."""
    from gap_cli.commands.pipeline import validate_run

    opened = open_run(root, run, skills, task)
    findings = validate_run(opened, source.value if source else None)
    errors = [f for f in findings if f.severity == "error"]
    if json:
        print_json({"run": opened.name, "valid": not errors, "findings": [f.as_dict() for f in findings]})
    else:
        if findings:
            for place, group in groupby(findings, key=place_of):
                rows = [(f.severity, f.code, within(f), f.source, f.message, f.hint) for f in group]
                print_table(place, ("", "rule", "where", "file", "what", "do"), rows)
        verdict = f"{opened.name}: {len(errors)} errors, {len(findings) - len(errors)} notes"
        step = f"gap rehearse {opened.argument}" if not errors else "fix the graph, then gap validate again"
        print_done(opened, "validate", [verdict], next_step=step)
    if errors:
        raise typer.Exit(1)


def place_of(finding: Finding) -> str:
    """The subgraph a finding is about, by its path; the workflow itself otherwise."""
    first, _, rest = finding.path.partition(".")
    return f"subgraph {rest.partition('.')[0]}" if first == "subgraphs" and rest else "workflow"


def within(finding: Finding) -> str:
    """Where in that subgraph, or in the workflow."""
    parts = finding.path.split(".", 2)
    return parts[2] if len(parts) == 3 and parts[0] == "subgraphs" else finding.path
