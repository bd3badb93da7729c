"""`gap tools`: every tool, and who serves it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from gap_cli.commands.common import AsJson, console, print_json, print_table

if TYPE_CHECKING:
    from gap_runtime.contracts.tool import ToolSpec
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
    tools = registry.tools
    listed = [
        _as_dict(tools[name].spec if name in tools else registry.contracts[name], registry)
        for name in sorted({*tools, *registry.contracts})
    ]
    if json:
        print_json(listed)
        return
    rows = [(t["name"], t["effect"], t["provider"] or "nobody", t["plugin"], t["summary"]) for t in listed]
    print_table("", ("tool", "effect", "provider", "plugin", ""), rows)


@app.command()
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A tool.", autocompletion=complete_tool)],
    json: AsJson = False,
) -> None:
    """Show the contract of one tool and who serves it."""
    from gap_runtime.plugins import load_registry

    registry = load_registry()
    tool = None if name in registry.contracts and name not in registry.providers else registry.tool(name)
    spec = registry.contracts[name] if tool is None else tool.spec
    data = {**_as_dict(spec, registry), **spec.schema, "doc": spec.doc}
    if json:
        print_json(data)
        return
    out = console()
    out.print(name, style="bold", markup=False)
    out.print(spec.doc + "\n", markup=False)
    if data["notes"]:
        out.print(f"As {data['provider']} serves it: {data['notes']}\n", markup=False)
    inputs: list[tuple[object, ...]] = [(p.name, p.type, "" if p.required else p.default) for p in spec.inputs]
    print_table("", ("input", "type", "default"), inputs or [("nothing", "", "")])
    given = spec.fields.items() if spec.fields else [("", spec.output or "nothing")]
    print_table("", ("output", "type"), given)
    held = ", ".join(spec.resources) or "nothing"
    out.print(f"\neffect {spec.effect}, holds {held}, deadline {spec.deadline_s:g} s", markup=False)
    providers = f"{', '.join(data['providers'])} (serving: {data['provider']})" if tool else "none is installed"
    out.print(f"providers: {providers}", markup=False)


def _as_dict(spec: ToolSpec, registry: Registry) -> dict[str, Any]:
    """A contract and who serves it: `provider` and `plugin` are empty where nobody does."""
    by_provider = registry.providers.get(spec.name, {})
    tool = registry.tool(spec.name) if by_provider else None
    return {
        "name": spec.name, "summary": spec.summary, "effect": spec.effect, "provider": tool.provider if tool else "",
        "plugin": tool.plugin if tool else "", "providers": sorted(by_provider), "notes": tool.notes if tool else "",
        "privileged": spec.privileged, "resources": list(spec.resources), "deadline_s": spec.deadline_s,
        "schema_hash": spec.schema_hash,
    }  # fmt: skip
