"""`gap tools`: every tool, and who serves it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, console, print_json, print_table

if TYPE_CHECKING:
    from gap_runtime.contracts.tool import Tool
    from gap_runtime.plugins import Registry


app = typer.Typer(name="tools", help="The tools graphs call.", no_args_is_help=True)


def complete_tool(incomplete: str) -> list[str]:
    """Names of registered tools, for shell completion."""
    from gap_runtime.plugins import load_registry

    return [name for name in load_registry().tools if name.startswith(incomplete)]


@app.command("list")
def list_tools(json: AsJson = False) -> None:
    """List the tools with their providers."""
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    listed = [_as_dict(tool, registry) for tool in registry.tools.values()]
    if json:
        print_json(listed)
        return
    rows = [(t["name"], t["effect"], t["provider"], t["plugin"], t["summary"]) for t in listed]
    print_table("", ("tool", "effect", "provider", "plugin", ""), rows)


@app.command()
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A tool.", autocompletion=complete_tool)],
    json: AsJson = False,
) -> None:
    """Show the contract of one tool and who serves it."""
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    tool = registry.tool(name)
    data = {**_as_dict(tool, registry), **tool.spec.schema, "doc": tool.spec.doc}
    if json:
        print_json(data)
        return
    out = console()
    out.print(name, style="bold", markup=False)
    out.print(tool.spec.doc + "\n", markup=False)
    inputs: list[tuple[object, ...]] = [(p.name, p.type, "" if p.required else p.default) for p in tool.spec.inputs]
    print_table("", ("input", "type", "default"), inputs or [("nothing", "", "")])
    given = tool.spec.fields.items() if tool.spec.fields else [("", tool.spec.output or "nothing")]
    print_table("", ("output", "type"), given)
    held = ", ".join(tool.spec.resources) or "nothing"
    out.print(f"\neffect {tool.spec.effect}, holds {held}, deadline {tool.spec.deadline_s:g} s", markup=False)
    out.print(f"providers: {', '.join(data['providers'])} (serving: {tool.provider})", markup=False)


def _as_dict(tool: Tool, registry: Registry) -> dict[str, Any]:
    spec = tool.spec
    return {
        "name": spec.name, "summary": spec.summary, "effect": spec.effect, "provider": tool.provider,
        "plugin": tool.plugin, "providers": sorted(registry.providers[spec.name]), "privileged": spec.privileged,
        "resources": list(spec.resources), "deadline_s": spec.deadline_s, "schema_hash": spec.schema_hash,
    }  # fmt: skip
