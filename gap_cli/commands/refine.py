"""`gap refine`: change the graph, prove each change on the same instances, keep what is better, say what it gained."""

from __future__ import annotations

from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from gap_cli.commands.common import RUNS, AsJson, Root, RunName, Skills, console, open_run, print_done, print_json
from gap_cli.commands.rehearse import Seed, Workers, episode_progress

if TYPE_CHECKING:
    from gap_cli.refine.loop import Iteration


def refine(
    run: RunName = None,
    iterations: Annotated[int, typer.Option(min=1, max=100, help="How many rounds at most.")] = 10,
    n: Annotated[int, typer.Option("-n", "--episodes", min=5, max=10_000, help="Tuning instances.")] = 30,
    candidates: Annotated[int, typer.Option(min=1, max=50, help="Changes raced in a round at most.")] = 4,
    proposers: Annotated[str, typer.Option(help="Who proposes, comma-separated.")] = "look,swap,structure,tune",
    budget: Annotated[float, typer.Option(min=0, help="Wall seconds after which no new race starts; 0: none.")] = 0,
    held_out: Annotated[int, typer.Option(min=0, max=100_000, help="Instances of the final judgement.")] = 100,
    seed: Seed = None,
    workers: Workers = 2,
    skills: Skills = None,
    root: Root = RUNS,
    json: AsJson = False,
) -> None:
    """Improve the graph on N instances and judge it once on others. Exit 1 where nothing was changed."""
    from gap_cli.refine.history import history_data
    from gap_cli.refine.run import refine_run, settings_of

    opened = open_run(root, run, skills)
    settings = settings_of(
        opened, seed, n=n, iterations=iterations, candidates=candidates, proposers=proposers, held_out=held_out,
        budget_s=budget or float("inf"),
    )  # fmt: skip
    with opened.held(), episode_progress(n * (1 + iterations * candidates) + held_out) as (progress, say):
        done = refine_run(opened, settings, workers, progress, lambda iteration: say(line(iteration)))
    data = history_data(done.history, done.episodes)
    if json:
        print_json({"run": opened.name, "path": str(opened.folder("refine")), **data})
    else:
        out = console()
        out.print(
            f"\nheld out    {done.history.judged}, longest run {done.history.longest_run}", style="bold", markup=False
        )
        out.print(f"stopped     {done.history.stopped}, after {done.episodes} episodes", markup=False)
        task = ":".join(filter(None, (opened.config.task, opened.config.variant)))
        last = opened.folder("refine") / f"{done.history.iterations[-1].number:02d}" / "bundle"
        print_done(opened, "refine", [], next_step=f"gap validate {quote(str(last))} --task {task}")
    if not done.history.changed:
        typer.echo("Nothing was changed.", err=True)
        raise typer.Exit(1)


def line(iteration: Iteration) -> str:
    """One round in one line: success, J, and what was kept or how the candidates ended."""
    kept = iteration.accepted
    outcomes = [t.verdict.outcome if t.verdict else "refused" for t in iteration.trials]
    what = f"+ {kept.title} ({kept.proposer})" if kept else ", ".join(outcomes) or "the graph as it came"
    return f"{iteration.number:>3}  success {iteration.rate.value:.2f}  J {iteration.objective:.3f}  {what}"
