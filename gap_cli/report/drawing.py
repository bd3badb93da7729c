"""The graph as inline SVG: one box per subgraph with its nodes and how it did, exits along the edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from gap_cli.analysis.exit_flow import top_links
from gap_cli.render.layout import Drawing, Placed, Point, lay_out
from gap_runtime.graph.model import START, Node, Workflow

CHAR, LINE = 7.4, 17.0  # px: of the monospace text inside a box
PAD, ASIDE = 12.0, 90.0
MIN_WIDTH = 96.0
GOOD, FAIR = 0.9, 0.5
_ARROW = (
    '<defs><marker id="arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    '<path d="M0 0 8 4 0 8z"/></marker></defs>'
)


@dataclass(frozen=True)
class Content:
    """What stands in one top-level node's box."""

    title: str
    css: str
    note: str = ""
    lines: tuple[tuple[str, str], ...] = ()

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [px]."""
        texts = (self.title, self.note, *(f"{name} {callee}" for name, callee in self.lines))
        rows = 1 + bool(self.note) + len(self.lines)
        return max(MIN_WIDTH, CHAR * max(map(len, texts)) + 2 * PAD), rows * LINE + 2 * PAD - 4


def graph_svg(workflow: Workflow, subgraphs: Mapping[str, Mapping[str, Any]]) -> str:
    """The drawing: what should happen from top to bottom, where failures lead to aside. `subgraphs` maps a top-level
    node to its entry in summary.json, where there is one."""
    contents = {START: Content("start", "start")}
    contents |= {name: _content(name, node, workflow, subgraphs.get(name)) for name, node in workflow.nodes.items()}
    aside = [name for name, node in workflow.nodes.items() if node.status == "failure"]
    links = edges(workflow)
    main = lay_out(
        {name: content.size for name, content in contents.items() if name not in aside},
        [link for link in links if link[1] not in aside],
    )
    boxes = dict(main.boxes) | _beside(main, {name: contents[name].size for name in aside})
    paths = [_edge(points, links[link]) for link, points in sorted(main.routes.items())]
    paths += [_failure(boxes[a], boxes[b], main, label) for (a, b), label in links.items() if b in aside]
    width = max(b.x + b.width for b in boxes.values()) + 2 * PAD
    height = max(b.y + b.height for b in boxes.values()) + 2 * PAD
    return (
        f'<svg class="graph" viewBox="{-PAD:.0f} {-PAD:.0f} {width:.0f} {height:.0f}" style="width:{width:.0f}px" '
        f'role="img" aria-label="the graph">{_ARROW}{"".join(paths)}'
        + "".join(_box(contents[name], box) for name, box in boxes.items())
        + "</svg>"
    )


def edges(workflow: Workflow) -> dict[tuple[str, str], str]:
    """Every top-level link with the exits that take it."""
    known = {START, *workflow.nodes}
    return {link: ", ".join(exits) for link, exits in top_links(workflow).items() if set(link) <= known}


def _content(name: str, node: Node, workflow: Workflow, stats: Mapping[str, Any] | None) -> Content:
    if node.type == "end":
        return Content(name, f"end {node.status or ''}", lines=tuple(("recover:", c.tool) for c in node.recovery))
    definition = workflow.subgraphs.get(node.ref or "")
    if definition is None:
        return Content(name, "subgraph", str(node.ref))
    lines = tuple((inner, _callee(d)) for inner, d in definition.nodes.items())
    if stats is None:
        return Content(name, "subgraph", definition.skill, lines)
    rate = stats["validation"]
    css = "good" if rate["rate"] >= GOOD else "fair" if rate["rate"] >= FAIR else "poor"
    return Content(name, f"subgraph {css}", f"{definition.skill} {rate['passed']}/{rate['of']}", lines)


def _callee(node: Node) -> str:
    return node.tool or (node.script or "").rpartition("/")[2] or node.type


def _box(content: Content, box: Placed) -> str:
    cx, y = box.x + box.width / 2, box.y + PAD + 9
    text = [f'<text class="name" x="{cx:.1f}" y="{y:.1f}">{escape(content.title)}</text>']
    if content.note:
        y += LINE
        text.append(f'<text class="note" x="{cx:.1f}" y="{y:.1f}">{escape(content.note)}</text>')
    for name, callee in content.lines:
        y += LINE
        ink = f'<tspan class="id">{escape(name)}</tspan><tspan dx="{CHAR:.1f}">{escape(callee)}</tspan>'
        text.append(f'<text class="node" x="{box.x + PAD:.1f}" y="{y:.1f}">{ink}</text>')
    return (
        f'<g class="{escape(content.css)}"><rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" rx="7"/>{"".join(text)}</g>'
    )


def _beside(main: Drawing, sizes: Mapping[str, tuple[float, float]]) -> dict[str, Placed]:
    """Boxes to the right of a drawing, standing on its ground."""
    placed, x = {}, main.width + ASIDE
    for name, (width, height) in sizes.items():
        placed[name] = Placed(x, max(0.0, main.height - height), width, height)
        x += width + ASIDE
    return placed


def _edge(points: Sequence[Point], label: str) -> str:
    (x, y), *rest = points
    path = f"M{x:.1f} {y:.1f}"
    for nx, ny in rest:
        bend = (ny - y) / 2
        path += f" C{x:.1f} {y + bend:.1f} {nx:.1f} {ny - bend:.1f} {nx:.1f} {ny:.1f}"
        x, y = nx, ny
    (x1, y1), (x2, y2) = points[0], points[1]
    return _path("edge", path, x1 + 0.42 * (x2 - x1), y1 + 0.42 * (y2 - y1) + 4, label)


def _failure(a: Placed, b: Placed, main: Drawing, label: str) -> str:
    """To the right, then down; below the boxes beside it, where there are any in the way."""
    x1, y1, (x2, y2) = a.x + a.width, a.y + a.height / 2, b.top
    start, clear = f"M{x1:.1f} {y1:.1f}", x1
    beside = [o for o in main.boxes.values() if x1 < o.x < b.x and o.y < y1 < o.y + o.height]
    if beside:
        foot = a.y + a.height
        x1, y1 = x1 - PAD, max([foot, *(o.y + o.height for o in beside)]) + PAD
        start = f"M{x1:.1f} {foot:.1f} V{y1 - 6:.1f} Q{x1:.1f} {y1:.1f} {x1 + 6:.1f} {y1:.1f}"
        clear = max(o.x + o.width for o in beside)
    bend = min(24.0, max(y2 - y1, 0.0))
    path = f"{start} H{x2 - bend:.1f} Q{x2:.1f} {y1:.1f} {x2:.1f} {y1 + bend:.1f} V{y2:.1f}"
    return _path("edge fails", path, clear + 10 + CHAR * len(label) / 2, y1 - 6, label)


def _path(css: str, path: str, x: float, y: float, label: str) -> str:
    text = f'<text class="exit" x="{x:.1f}" y="{y:.1f}">{escape(label)}</text>' if label else ""
    return f'<path class="{css}" d="{path}" marker-end="url(#arrow)"/>{text}'
