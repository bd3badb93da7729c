"""`gap validate`: every rule over the graph, every finding at once."""

from __future__ import annotations

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, RunName, print_done, print_json, print_table, spelled


def validate(run: RunName = None, root: Root = RUNS, json: AsJson = False) -> None:
    """Check the graph against the tools, skills and objects there are. Exit 1 where an error is found."""
    from gap_cli.artifacts.run import Run
    from gap_cli.commands.pipeline import validate_run

    opened = Run.open(root, run)
    findings = validate_run(opened)
    errors = [f for f in findings if f.severity == "error"]
    if json:
        print_json({"run": opened.name, "valid": not errors, "findings": [f.as_dict() for f in findings]})
    else:
        if findings:
            rows = [(f.severity, f.code, f.path, f.message, f.hint) for f in findings]
            print_table("", ("", "rule", "where", "what", "do"), rows)
        verdict = f"{opened.name}: {len(errors)} errors, {len(findings) - len(errors)} notes"
        step = f"gap rehearse {spelled(opened)}" if not errors else "mend the graph, then gap validate again"
        print_done(opened, "validate", [verdict], next_step=step)
    if errors:
        raise typer.Exit(1)
