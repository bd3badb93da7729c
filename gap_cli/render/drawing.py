"""A workflow as SVG: every subgraph a box with its nodes inside, each node addressable by its path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from gap_cli.analysis.exit_flow import top_links
from gap_cli.render.layout import Drawing, Link, Placed, Point, lay_out
from gap_cli.render.tree import what
from gap_runtime.graph.model import END, START, Node, Routing, SubgraphDef, Workflow

CHAR, SMALL = 7.3, 6.1  # px per character of a name and of what stands below it
PAD, HEAD, TALL = 14.0, 40.0, 40.0
DOT = (12.0, 12.0)
_ARROW = (
    '<defs><marker id="arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
    'orient="auto-start-reverse"><path d="M0 0 8 4 0 8z"/></marker></defs>'
)


@dataclass(frozen=True)
class SubgraphDrawing:
    """A subgraph's inside, drawn from (0, 0), and its size [px]."""

    svg: str
    width: float
    height: float


def drawing(workflow: Workflow) -> str:
    """The SVG. A group carries `data-path`: `subgraph/node`, or the name of a top-level node."""
    parts = {
        name: _inside(name, workflow.subgraphs[node.ref])
        for name, node in workflow.nodes.items()
        if node.ref in workflow.subgraphs
    }
    sizes = {START: DOT} | {name: _top_size(name, node, parts) for name, node in workflow.nodes.items()}
    exits = top_links(workflow)
    placed = lay_out(sizes, list(exits))
    labels = {link: ", ".join(values) for link, values in exits.items() if values}
    boxes = [_top(name, node, placed.boxes[name], parts, workflow) for name, node in workflow.nodes.items()]
    start = _dot(placed.boxes[START])
    width, height = placed.width + 2 * PAD, placed.height + 2 * PAD
    return (
        f'<svg class="graph" viewBox="{-PAD} {-PAD} {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" role="img" aria-label="the graph">{_ARROW}{start}{"".join(boxes)}'
        f"{_paths(placed, labels)}</svg>"
    )


def _inside(path: str, definition: SubgraphDef) -> SubgraphDrawing:
    links, labels = _links(definition.edges, definition.conditional_edges)
    ends = {END: DOT} if any(END in link for link in links) else {}
    sizes = {START: DOT} | {name: _size(name, node) for name, node in definition.nodes.items()} | ends
    placed = lay_out(sizes, links)
    nodes = [_node(f"{path}/{name}", name, node, placed.boxes[name]) for name, node in definition.nodes.items()]
    dots = [_dot(placed.boxes[name]) for name in (START, *ends)]
    return SubgraphDrawing("".join(nodes) + "".join(dots) + _paths(placed, labels), placed.width, placed.height)


def _links(edges: Sequence[tuple[str, str]], routing: Mapping[str, Routing]) -> tuple[list[Link], dict[Link, str]]:
    labels: dict[Link, list[str]] = {(a, b): [] for a, b in edges}
    for a, routes in routing.items():
        for value, b in routes.mapping.items():
            labels.setdefault((a, b), []).extend([value] if value != b else [])
    return list(labels), {link: ", ".join(values) for link, values in labels.items() if values}


def _size(name: str, node: Node) -> tuple[float, float]:
    if node.type == "noop":
        return max(52.0, CHAR * len(name) + 24), 26.0
    return max(CHAR * len(name), SMALL * len(what(node))) + 24, TALL


def _top_size(name: str, node: Node, parts: Mapping[str, SubgraphDrawing]) -> tuple[float, float]:
    if name not in parts:
        return max(80.0, CHAR * len(name) + 28), 34.0
    part = parts[name]
    return max(part.width, CHAR * (len(name) + 6) + 60) + 2 * PAD, part.height + HEAD + PAD


def _top(name: str, node: Node, box: Placed, parts: Mapping[str, SubgraphDrawing], workflow: Workflow) -> str:
    if name not in parts:
        css = f"end {node.status or ''}"
        return _group(name, css, _rect(box, 17) + _text("name", box, name, box.height / 2 + 4.5))
    definition = workflow.subgraphs[node.ref or ""]
    x = box.x + (box.width - parts[name].width) / 2
    inside = f'<g transform="translate({x:.1f} {box.y + HEAD:.1f})">{parts[name].svg}</g>'
    title = _text("title", box, name, 17) + _text("what", box, definition.skill, 31)
    return _group(name, "subgraph", _rect(box, 10) + title) + inside


def _node(path: str, name: str, node: Node, box: Placed) -> str:
    css = f"node {node.type}" + (" streaming" if node.streaming else "")
    if node.type == "noop":
        return _group(path, css, _rect(box, 13) + _text("name", box, name, 17))
    text = _text("name", box, name, 17) + _text("what", box, what(node), 31)
    return _group(path, css, _rect(box, 6) + text)


def _group(path: str, css: str, inner: str) -> str:
    return f'<g class="{escape(css)}" data-path="{escape(path, quote=True)}" tabindex="0">{inner}</g>'


def _rect(box: Placed, radius: float) -> str:
    return f'<rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}" rx="{radius:g}"/>'


def _text(css: str, box: Placed, text: str, y: float) -> str:
    return f'<text class="{css}" x="{box.x + box.width / 2:.1f}" y="{box.y + y:.1f}">{escape(text)}</text>'


def _dot(box: Placed) -> str:
    return f'<circle class="dot" cx="{box.x + box.width / 2:.1f}" cy="{box.y + box.height / 2:.1f}" r="4.5"/>'


def _paths(placed: Drawing, labels: Mapping[Link, str]) -> str:
    found = []
    for link, points in sorted(placed.routes.items()):
        found.append(f'<path class="link" d="{_curve(points)}" marker-end="url(#arrow)"/>')
        if link in labels:
            (x1, y1), (x2, y2) = points[0], points[1]
            x, y = x1 + 0.42 * (x2 - x1), y1 + 0.42 * (y2 - y1)
            found.append(f'<text class="label" x="{x:.1f}" y="{y:.1f}">{escape(labels[link])}</text>')
    return "".join(found)


def _curve(points: Sequence[Point]) -> str:
    (x, y), *rest = points
    path = f"M{x:.1f} {y:.1f}"
    for nx, ny in rest:
        bend = (ny - y) / 2
        path += f" C{x:.1f} {y + bend:.1f} {nx:.1f} {ny - bend:.1f} {nx:.1f} {ny:.1f}"
        x, y = nx, ny
    return path
