"""`gap plan`: from a sentence to the topology of a graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, Skills, complete_task, print_done, print_json


def plan(
    sentence: Annotated[str | None, typer.Argument(metavar="SENTENCE", help="What the robot shall do.")] = None,
    task: Annotated[
        str | None,
        typer.Option(
            "--task", "-t", autocompletion=complete_task, help="A task; the one that serves the sentence when left out."
        ),
    ] = None,
    say: Annotated[str | None, typer.Option("--say", "-s", help="The sentence, as an option.")] = None,
    variant: Annotated[str, typer.Option(help="A variant of the task; its first when left out.")] = "",
    author: Annotated[str, typer.Option(help="Who writes the graph.")] = "symbolic",
    seed: Annotated[int, typer.Option(min=0, help="Base seed of this run's rehearsals.")] = 0,
    provider: Annotated[
        list[str] | None, typer.Option(metavar="TOOL=NAME", help="Serve a tool, or service.*, by this provider.")
    ] = None,
    skills: Skills = None,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Decide which skill serves which segment of the task, and start a run."""
    from gap_cli.commands.pipeline import plan_run, serving_task
    from gap_cli.workspace.run import RunConfig
    from gap_runtime.contracts.documents import read_json

    if (sentence is None) == (say is None):
        raise typer.BadParameter("give one sentence, in quotes", param_hint="SENTENCE")
    text = sentence or say or ""
    question: dict[str, Any] = {"instruction": text, "variant": variant, "author": author, "seed": seed}
    question["task"] = serving_task(text) if task is None else task
    question |= {"providers": _pairs(provider or []), "skills": [str(p.resolve()) for p in skills or ()]}
    config = RunConfig.load(question, "gap plan")
    run = plan_run(Path(root), config)
    data = read_json(run.folder("plan") / "plan.json")
    if json:
        print_json({"run": run.name, "path": str(run.path), "plan": data})
        return
    segments = [f"  {s['name']}: {s['skill']}" for s in data.get("segments", [])]
    print_done(run, "plan", [f"{run.name}: {text}", *segments], next_step=f"gap generate {run.argument}")


def _pairs(given: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in given:
        tool, equals, name = text.partition("=")
        if not (tool and equals and name):
            raise typer.BadParameter(f"{text!r} is not TOOL=NAME", param_hint="--provider")
        found[tool] = name
    return found
