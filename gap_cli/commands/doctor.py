"""`gap doctor`: what this machine has, what it lacks, and what to type about it."""

from __future__ import annotations

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, print_json, print_table


def doctor(root: Root = RUNS, json: AsJson = False) -> None:
    """Check this machine. Exit 1 when something GaP needs is missing."""
    from gap_cli.commands.checks import run_checks

    findings = run_checks(root)
    missing = [f for f in findings if f.needed and not f.ok]
    if json:
        print_json({"ok": not missing, "checks": [f._asdict() for f in findings]})
    else:
        rows = [("ok" if f.ok else "MISSING" if f.needed else "-", f.check, f.found, f.hint) for f in findings]
        print_table("", ("", "check", "found", "do"), rows)
    if missing:
        raise typer.Exit(1)
