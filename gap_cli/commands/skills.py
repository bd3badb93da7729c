"""`gap skills`: the skill library: list it, read one skill, check one, start a new one."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, Skills, console, print_json, print_table

if TYPE_CHECKING:
    from gap_cli.skills import SkillBundle, SkillLibrary

app = typer.Typer(name="skills", help="The skills graphs are made of.", no_args_is_help=True)


def complete_skill(incomplete: str) -> list[str]:
    """Names of installed skills, for shell completion."""
    return [name for name in _library() if name.startswith(incomplete)]


@app.command("list")
def list_skills(skills: Skills = None, json: AsJson = False) -> None:
    """List the installed skills."""
    listed = [_as_dict(bundle) for bundle in _library(skills).values()]
    if json:
        print_json(listed)
        return
    rows = [(s["name"], s["stage"] or "-", s["plugin"], s["description"].split(". ")[0]) for s in listed]
    print_table("", ("skill", "stage", "plugin", ""), rows)


@app.command()
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A skill.", autocompletion=complete_skill)],
    skills: Skills = None,
    json: AsJson = False,
) -> None:
    """Show what agents read about one skill, and its typed contract."""
    bundle = _library(skills).find(name)
    if json:
        contract = bundle.contract.model_dump(mode="json", exclude_defaults=True)
        print_json({**_as_dict(bundle), "contract": contract, "body": bundle.body})
        return
    from rich.markdown import Markdown

    console().print(Markdown(bundle.body))
    rows = [(kind, n, t) for kind in ("inputs", "outputs") for n, t in getattr(bundle.contract, kind).items()]
    print_table("", ("", "name", "type"), rows)
    print_table("", ("parameter", "default", "range", "unit", ""), _parameters(bundle))
    print_table("", ("tool",), [(tool,) for tool in bundle.contract.tools])
    console().print(f"{bundle.path} (plugin {bundle.plugin})", markup=False, soft_wrap=True, style="dim")


@app.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The skill's name, lower-case words and hyphens.")],
    into: Annotated[Path, typer.Option(help="The folder to make it in.", file_okay=False)] = Path(),
    json: AsJson = False,
) -> None:
    """Start a plugin with a skill and a tool of your own."""
    from gap_cli.skills.scaffold import new_plugin

    files = new_plugin(name, into, _library())
    if json:
        print_json({"name": name, "path": str(into / name), "files": [str(f) for f in files]})
        return
    out = console()
    for file in files:
        out.print(str(file), markup=False, soft_wrap=True)
    out.print(f"next:  pip install -e {quote(str(into / name))}", markup=False, soft_wrap=True, style="bold")


@app.command()
def check(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="PATH...", help="Skills, or folders of skills at any depth.", exists=True, file_okay=False
        ),
    ],
    json: AsJson = False,
) -> None:
    """Check skills: SKILL.md, contract, scripts, template, and the graph they make. Exit code 1 for problems."""
    from gap_cli.author.skill_check import check_folder
    from gap_cli.skills.library import find_skills
    from gap_runtime.plugins import load_registry

    tools = {name: tool.spec for name, tool in load_registry().tools.items()}
    folders = dict.fromkeys(folder for path in paths for folder in find_skills(path))
    found = {str(folder): check_folder(folder.resolve(), tools) for folder in folders}
    bad = sum(f.severity == "error" for findings in found.values() for f in findings)
    if json:
        print_json([{"skill": path, **f.as_dict()} for path, findings in found.items() for f in findings])
    else:
        rows = [(path, f.code, f.path, f"{f.message} {f.hint}".strip()) for path, fs in found.items() for f in fs]
        if rows:
            print_table("", ("skill", "rule", "where", ""), rows)
        console().print(f"{len(found)} checked, {bad} problem{'' if bad == 1 else 's'}", markup=False)
    if bad:
        raise typer.Exit(1)


def _library(own: list[Path] | None = None) -> SkillLibrary:
    from gap_cli.skills import load_library
    from gap_runtime.plugins import load_registry

    return load_library(load_registry().skill_paths, own or ())


def _as_dict(bundle: SkillBundle) -> dict[str, Any]:
    contract = bundle.contract
    return {
        "name": bundle.name, "description": bundle.description, "plugin": bundle.plugin, "kind": contract.kind,
        "stage": contract.stage, "roles": contract.roles, "inputs": contract.inputs, "outputs": contract.outputs,
        "needs": contract.needs, "effects": contract.effects,
        "exits": [*contract.exits.success, contract.exits.failure], "tools": contract.tools,
        "parameters": list(contract.parameters), "swaps": contract.swaps, "digest": bundle.digest,
        "path": str(bundle.path),
    }  # fmt: skip


def _parameters(bundle: SkillBundle) -> list[tuple[Any, ...]]:
    rows = bundle.contract.parameters.items()
    return [(n, p.default, list(p.range or p.choices or []), p.unit, p.description) for n, p in rows]
