"""`gap import`: a graph or a skill of another dialect, translated as far as it can be."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, console, print_json, print_table

if TYPE_CHECKING:
    from gap_cli.importer import Imported


def import_(
    path: Annotated[
        Path,
        typer.Argument(
            help="A workflow.json, its folder, a builder script, a skill, or a folder of skills.", exists=True
        ),
    ],
    out: Annotated[Path, typer.Option(help="Where the result goes, in a folder of its name.")] = Path("imported"),
    json: AsJson = False,
) -> None:
    """Translate a foreign graph or skill, and say what was mapped, guessed and left. Exit 1 where problems remain."""
    from gap_cli.importer import import_path
    from gap_cli.skills import load_library
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    tools = {name: tool.spec for name, tool in registry.tools.items()}
    made = import_path(path, out, tools, load_library(registry.skill_paths))
    if json:
        print_json([_as_dict(one) for one in made])
    else:
        for one in made:
            _show(one)
    if any(f.severity == "error" for one in made for f in one.findings):
        raise typer.Exit(1)


def _show(one: Imported) -> None:
    out = console()
    rows = [(r.verdict, r.where, r.was, r.now, r.note) for r in one.rows]
    print_table("", ("", "where", "was", "is now", ""), rows)
    problems = [(f.code, f.path, f"{f.message} {f.hint}".strip()) for f in one.findings]
    if problems:
        print_table("\nWhat is still wrong:", ("rule", "where", ""), problems)
    count = {verdict: sum(r.verdict == verdict for r in one.rows) for verdict in ("mapped", "guessed", "left")}
    counts = ", ".join(f"{n} {verdict}" for verdict, n in count.items())
    out.print(f"\n{one.kind} {one.path}: {counts}, {len(problems)} problems remain", markup=False, soft_wrap=True)
    verb = "skills check" if one.kind == "skill" else "validate"
    out.print(f"next:  gap {verb} {quote(str(one.path))}", markup=False, soft_wrap=True, style="bold")


def _as_dict(one: Imported) -> dict[str, Any]:
    rows = [{k: v for k, v in asdict(row).items() if v} for row in one.rows]
    findings = [f.as_dict() for f in one.findings]
    return {"kind": one.kind, "path": str(one.path), "translations": rows, "findings": findings}
