"""`gap report`: the run as one HTML page."""

from __future__ import annotations

from gap_cli.commands.common import RUNS, AsJson, Root, RunName, console, print_json


def report(run: RunName = None, root: Root = RUNS, json: AsJson = False) -> None:
    """Write report.html: graph, rates, failures, pictures and how to reproduce, in one file that needs no network."""
    from gap_cli.report.page import write_report
    from gap_cli.workspace.run import Run

    opened = Run.open(root, run)
    with opened.held():
        page = write_report(opened)
    if json:
        print_json({"run": opened.name, "report": str(page), "bytes": page.stat().st_size})
    else:
        console().print(f"report: {page}", markup=False, soft_wrap=True)
