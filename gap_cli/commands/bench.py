"""`gap bench`: measure, and write what the documentation quotes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gap_cli.commands.common import AsJson, console, print_json, print_table

if TYPE_CHECKING:
    from gap_runtime.contracts.bench import BenchReport, Progress
    from gap_runtime.plugins import Registry

RESULTS = Path("docs/results")


def bench(
    name: Annotated[str | None, typer.Argument(help="Which benchmark; a list of them when left out.")] = None,
    n: Annotated[int | None, typer.Option("-n", min=1, help="How many samples: rounds, scenes or problems.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of the first sample, where samples are drawn.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes, where samples can be measured side by side.")] = 1,
    to: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the table goes, as Markdown and JSON.")] = RESULTS,
    save: Annotated[bool, typer.Option(help="Write the table to the folder.")] = True,
    json: AsJson = False,
) -> None:
    """Run a benchmark: a table with the command, the machine and the versions behind it."""
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    found = registry.benchmarks
    if name is None:
        rows = [(entry.name, entry.plugin) for _, entry in sorted(found.items())]
        if json:
            print_json([{"name": n, "plugin": plugin} for n, plugin in rows])
        else:
            print_table("", ("benchmark", "from"), rows)
        return
    if name not in found:
        from gap_runtime.errors import UnknownNameError

        raise UnknownNameError("benchmark", name, found)
    from gap_cli.bench.report import as_data, markdown, picture_files
    from gap_cli.workspace.atomic import replace_files
    from gap_cli.workspace.canonical import write_json, write_text

    options = {"-n": n, "--seed": seed}
    command = " ".join([f"gap bench {name}", *(f"{k} {v}" for k, v in options.items() if v is not None)])
    report = measure(registry, name, n, seed, workers)
    data = as_data(name, report, command)
    if json:
        print_json(data)
    else:
        typer.echo(markdown(data))
    if save:
        write_json(to / f"{name}.json", data)
        write_text(to / f"{name}.md", markdown(data))
        replace_files({to / file: content for file, content in picture_files(name, report).items()})
        if not json:
            console().print(f"written: {to / f'{name}.md'} and {name}.json", style="dim", markup=False)


def measure(registry: Registry, name: str, n: int | None, seed: int | None, workers: int) -> BenchReport:
    """Run a registered benchmark, with a progress bar where someone watches."""
    from gap_cli.bench.context import BenchRun

    with progress_bar(name) as watch:
        report: BenchReport = registry.benchmarks[name].value(BenchRun(registry, n, seed, workers, watch))
    return report


@contextmanager
def progress_bar(name: str) -> Iterator[Progress]:
    """A bar on stderr where someone watches."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=1.0)
        yield lambda done, what: bar.update(task, completed=done, description=f"{name}: {what}" if what else name)
