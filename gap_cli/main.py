"""The `gap` command: a list of verbs, and the one place where an error becomes a line and an exit code."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from gap_cli import __version__
from gap_cli.commands import error_handler
from gap_cli.commands.bench import bench
from gap_cli.commands.demo import demo
from gap_cli.commands.doctor import doctor
from gap_cli.commands.generate import generate
from gap_cli.commands.importing import import_
from gap_cli.commands.plan import plan
from gap_cli.commands.refine import refine
from gap_cli.commands.rehearse import rehearse
from gap_cli.commands.report import report
from gap_cli.commands.run import run
from gap_cli.commands.schema import schema
from gap_cli.commands.skills import app as skills
from gap_cli.commands.tasks import app as tasks
from gap_cli.commands.tools import app as tools
from gap_cli.commands.validate import validate
from gap_cli.commands.view import view

app = typer.Typer(
    name="gap",
    help="From a sentence about a manipulation task to a rehearsed graph of robot skills.",
    epilog="Start with: gap demo",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

PIPELINE, LIBRARY, UTILITIES = "Pipeline", "Library", "Utilities"
app.command(rich_help_panel=PIPELINE)(plan)
app.command(rich_help_panel=PIPELINE)(generate)
app.command(rich_help_panel=PIPELINE)(validate)
app.command(rich_help_panel=PIPELINE)(rehearse)
app.command(rich_help_panel=PIPELINE)(refine)
app.command(rich_help_panel=PIPELINE)(report)
app.command(rich_help_panel=PIPELINE)(run)
app.command(rich_help_panel=PIPELINE)(view)
app.command(rich_help_panel=PIPELINE)(demo)
app.add_typer(skills, rich_help_panel=LIBRARY)
app.add_typer(tools, rich_help_panel=LIBRARY)
app.add_typer(tasks, rich_help_panel=LIBRARY)
app.command("import", rich_help_panel=LIBRARY)(import_)
app.command(rich_help_panel=UTILITIES)(bench)
app.command(rich_help_panel=UTILITIES)(doctor)
app.command(rich_help_panel=UTILITIES)(schema)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gap {__version__}")
        raise typer.Exit


@app.callback()
def gap(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """From a sentence about a manipulation task to a rehearsed graph of robot skills."""
    error_handler.require_working_directory()


def main() -> None:
    """Run the command line. Exit codes: 0 done, 1 the user's input, 2 usage, 3 a bug, 130 interrupted."""
    error_handler.tolerate_any_terminal()
    error_handler.show_warnings()
    try:
        app(prog_name="gap")
    except SystemExit as ended:
        error_handler.finish(ended)
    except BaseException as error:
        code = error_handler.report(error, sys.argv)
        error_handler.flush()
        # Worker threads of a library must not keep an interrupted or failed command alive.
        os._exit(code) if code in (3, 130) else sys.exit(code)


if __name__ == "__main__":
    main()
