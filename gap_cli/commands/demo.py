"""`gap demo`: the whole pipeline on one sentence."""

from __future__ import annotations

from typing import Annotated

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, console, print_json
from gap_cli.commands.rehearse import Episodes, Workers

TASK = "fulfill-grocery"
SENTENCE = "Pick the alphabet soup and place it in the basket"


def demo(
    n: Episodes = 10,
    workers: Workers = 2,
    say: Annotated[str, typer.Option("--say", help="Another sentence.")] = SENTENCE,
    task: Annotated[str, typer.Option(help="Another task.")] = TASK,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Plan, generate, validate, rehearse and report: one command from a sentence to a number."""
    from gap_cli.commands.pipeline import generate_run, plan_run, validate_run
    from gap_cli.commands.rehearse import Recorded, print_evaluation, raise_for, rehearse_run
    from gap_cli.report.page import write_report
    from gap_cli.workspace.run import RunConfig
    from gap_runtime.errors import WorkflowError

    out = console()

    def step(text: str) -> None:
        if not json:
            out.print(text, markup=False, soft_wrap=True)

    step(f'"{say}"')
    run = plan_run(root, RunConfig(task=task, instruction=say))
    step(f"plan      -> {run.folder('plan')}")
    made = generate_run(run)
    step(f"generate  -> {run.folder('generate')}: {made['nodes']} nodes in {made['subgraphs']} subgraphs")
    errors = [f for f in validate_run(run) if f.severity == "error"]
    if errors:
        raise WorkflowError(errors)
    step(f"validate  -> {run.folder('validate')}: no errors")
    step(f"rehearse  -> {run.folder('rehearse/00')}: {n} instances on {workers} workers")
    found = rehearse_run(run, n, None, workers, Recorded.failed)
    with run.held():
        page = write_report(run)
    if json:
        print_json({"run": run.name, "path": str(run.path), "summary": found.summary, "clock": found.clock,
                    "report": str(page)})  # fmt: skip
    else:
        out.print()
        print_evaluation(found)
        out.print()
        for name, path in (
            ("graph", "generate/workflow.json"),
            ("feedback", "rehearse/00/feedback.md"),
            ("report", "report.html"),
        ):
            out.print(f"{name:9} {run.path / path}", markup=False, soft_wrap=True)
    raise_for(found)
