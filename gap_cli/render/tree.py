"""A workflow as a tree for the terminal, with how each node did where a run is known."""

from __future__ import annotations

from collections.abc import Mapping

from rich.markup import escape
from rich.tree import Tree

from gap_cli.analysis.exit_flow import exit_targets, side_by_side
from gap_cli.render.timeline import RunTimeline, Visit
from gap_runtime.graph.model import END, START, Node, SubgraphDef, Workflow

MARKS = {"finished": "[green]✓[/]", "failed": "[red]✗[/]", "cancelled": "[yellow]–[/]", "running": "[blue]…[/]"}


def tree(workflow: Workflow, timeline: RunTimeline | None = None) -> Tree:
    """Subgraphs in the order control reaches them, their nodes below, exits and where they lead at the end."""
    root = Tree(f"[bold]{escape(workflow.meta.get('name', 'workflow'))}[/]")
    visits = {} if timeline is None else timeline.latest
    beside = side_by_side(workflow)
    for name in reading_order(list(workflow.nodes), _links(workflow.edges, workflow.conditional_edges)):
        node = workflow.nodes[name]
        definition = workflow.subgraphs.get(node.ref or "")
        if definition is None:
            mark = _mark(timeline is not None and timeline.end == name)
            root.add(f"{mark}[bold]{escape(name)}[/] [dim]end, {node.status}[/]")
            continue
        exits = timeline.exits.get(name, []) if timeline else []
        took = f" [bold]-> {escape(', '.join(exits))}[/]" if exits else ""
        others = f", beside {escape(', '.join(beside[name]))}" if name in beside else ""
        branch = root.add(f"[bold cyan]{escape(name)}[/] [dim]{escape(definition.skill)}{others}[/]{took}")
        _nodes(branch, name, definition, visits)
        for value, targets in exit_targets(workflow, name, definition).items():
            branch.add(f"[dim]{escape(value)} -> {escape(' and '.join(targets))}[/]")
    return root


def reading_order(names: list[str], links: Mapping[str, list[str]]) -> list[str]:
    """Names as control first reaches them from START, breadth first; then any it never does."""
    found = [START]
    for name in found:
        found += [n for n in dict.fromkeys(links.get(name, ())) if n not in found and n in names]
    return [*found[1:], *(n for n in names if n not in found)]


def _nodes(branch: Tree, name: str, definition: SubgraphDef, visits: Mapping[str, Visit]) -> None:
    links = _links(definition.edges, definition.conditional_edges)
    for inner in reading_order(list(definition.nodes), links):
        node = definition.nodes[inner]
        visit = visits.get(f"{name}/{inner}")
        ways = [n for n in links.get(inner, ()) if n != END]
        after = f" [dim]-> {escape(', '.join(ways))}[/]" if len(ways) > 1 else ""
        branch.add(f"{_visit(visit)}{escape(inner)}  [dim]{escape(what(node))}[/]{after}{_timing(visit)}")


def what(node: Node) -> str:
    """What a node calls, in a word."""
    name = node.tool or (node.script or "").rpartition("/")[2] or node.type
    return f"{name} (streaming)" if node.streaming else name


def _links(edges: list[tuple[str, str]], routing: Mapping[str, object]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for a, b in edges:
        found.setdefault(a, []).append(b)
    for a, routes in routing.items():
        found.setdefault(a, []).extend(getattr(routes, "mapping", {}).values())
    return found


def _visit(visit: Visit | None) -> str:
    return "" if visit is None else f"{MARKS.get(visit.status, ' ')} "


def _mark(reached: bool) -> str:
    return f"{MARKS['finished']} " if reached else ""


def _timing(visit: Visit | None) -> str:
    if visit is None:
        return ""
    moved = f", {visit.world_s:.2f} s of motion" if visit.world_s else ""
    error = f" [red]{escape(visit.error)}[/]" if visit.error else ""
    return f" [dim]{visit.compute_s * 1000:.0f} ms{moved}[/]{error}"
